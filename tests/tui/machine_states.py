"""A machine as its pages are shown it: flags of its axes, one look at it, and an alignment that is complete."""

from __future__ import annotations

from console.session.alignment import Alignment, Clamping, JawAngle, TouchOff
from drivers.snapshot import AxisState, Snapshot

REST = frozenset({"desired_velocity_zero", "in_position"})
ON = REST | {"amplifier_enabled", "home_complete"}

CLAMPED = Clamping(force_n=1314.0, diameter_mm=52.0, overhang_mm=30.0, at="08:40")
JAW = JawAngle(angle_deg=12.6, at="08:45")


def aligned(zero_radius_mm: float) -> Alignment:
    """Everything is done; the tip was found at this radius at position zero."""
    touched = TouchOff(zero_radius_mm=zero_radius_mm, at="08:46")
    return Alignment(settings=(), drives_on=True, homed=True, clamping=CLAMPED, jaw=JAW, touch_off=touched)


def look_at(
    flags: frozenset[str],
    *,
    tool: float,
    spindle: float,
    carriage: float,
    tool_error: float = 0.0,
    at_s: float = 100.0,
    running: bool = False,
) -> Snapshot:
    """One look; positions in counts."""

    def axis(position: float, error: float = 0.0) -> AxisState:
        return AxisState(position=position, following_error=error, flags=flags)

    return Snapshot(
        asked_s=at_s,
        at_s=at_s,
        tool=axis(tool, tool_error),
        spindle=axis(spindle),
        carriage=axis(carriage),
        program_running=running,
        runtime_error=False,
    )
