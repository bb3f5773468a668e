"""A machine as its pages are shown it: flags of its axes, one look at it, and an alignment that is complete."""

from __future__ import annotations

from console.session.cut.alignment import Alignment, JawAngle, TouchOff, clamping_of
from drivers.lathe.snapshot import AxisState, Snapshot
from profiles.store import load_job

REST = frozenset({"desired_velocity_zero", "in_position"})
ON = REST | {"amplifier_enabled", "home_complete"}

CLAMPED = clamping_of(load_job("lee-2001-experiment-1").job, at="08:40")
JAW = JawAngle(angle_deg=12.6, jaws=3, at="08:45")


def aligned(zero_radius_mm: float) -> Alignment:
    """Everything is done; the tip was found at this radius at position zero."""
    touched = TouchOff(zero_radius_mm=zero_radius_mm, diameter_mm=52.0, at="08:46")
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
