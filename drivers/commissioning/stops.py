"""Compute the stopping distance of each axis from the settings read back. Counts and ms."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.commissioning.amounts import digits, length, speed
from drivers.commissioning.check import Check, Group, severity
from drivers.commissioning.judged import Judged, JudgedAxis
from drivers.lathe.motion import LINK_LATENCY_MS
from drivers.pmac.trajectory.jog import SHORTEST_RAMP_MS, JogSettings, change_speed
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True)
class StoppingDistance:
    """From the press of the stop key to rest."""

    time_ms: float
    counts: float


def after_abort(speed_counts_per_ms: float, rate: float, late_ms: float) -> StoppingDistance:
    """Return the distance at Ix15 = `rate`; a rate of 0 never stops a motor."""
    if rate <= 0.0:
        return StoppingDistance(math.inf, math.inf)
    way = speed_counts_per_ms * late_ms + speed_counts_per_ms**2 / (2.0 * rate)
    return StoppingDistance(late_ms + speed_counts_per_ms / rate, way)


def after_jog_stop(settings: JogSettings, late_ms: float) -> StoppingDistance:
    """Return the distance of a jog at its speed that is ended by J/."""
    pieces = change_speed(0.0, settings.speed, 0.0, settings)
    ramp_ms = sum(piece.duration_ms for piece in pieces)
    # A ramp is symmetrical about its middle, whatever its S-curve.
    return StoppingDistance(late_ms + ramp_ms, settings.speed * (late_ms + ramp_ms / 2.0))


def jog_settings_of(judged: Judged, axis: JudgedAxis) -> JogSettings:
    """Return the jog settings read from an axis; Ix20 and Ix21 both 0 count as 1 ms."""
    ta_ms, ts_ms = max(0.0, judged.of_motor(axis, 20)), max(0.0, judged.of_motor(axis, 21))
    return JogSettings(
        acceleration=judged.of_motor(axis, 19),
        ta_ms=ta_ms or (0.0 if ts_ms else SHORTEST_RAMP_MS),
        ts_ms=ts_ms,
        speed=abs(judged.of_motor(axis, 22)),
    )


def overruns(judged: Judged) -> list[Check]:
    """Return the stopping distance of each axis in mid-jog, by control-A and by J/."""
    return [_overrun(judged, axis) for axis in judged.driven_axes]


def _overrun(judged: Judged, axis: JudgedAxis) -> Check:
    machine = judged.machine
    late_ms = machine.controller.background_ms + LINK_LATENCY_MS
    settings = jog_settings_of(judged, axis)
    abort = after_abort(settings.speed, judged.of_motor(axis, 15), late_ms)
    jog = after_jog_stop(settings, late_ms)
    limit = _clearance_counts(machine, axis)
    return Check(
        Group.STOPS,
        "overrun",
        severity(max(abort.counts, jog.counts) <= limit),
        subject=axis.name,
        wanted=f"<= {length(limit, axis.motor, machine)}",
        facts={
            "speed": speed(settings.speed, axis.motor, machine),
            "abort_way": _way(abort, axis, machine),
            "jog_way": _way(jog, axis, machine),
            "ramp": _way(after_jog_stop(settings, late_ms=0.0), axis, machine),
        },
    )


def _way(stopping: StoppingDistance, axis: JudgedAxis, machine: MachineProfile) -> str:
    if math.isinf(stopping.counts):
        return "∞"
    return f"{length(stopping.counts, axis.motor, machine)}, {digits(stopping.time_ms / 1000.0)} s"


def _clearance_counts(machine: MachineProfile, axis: JudgedAxis) -> float:
    """Return the available stopping distance: to the work, one turn, to the jaws."""
    match axis.name:
        case "tool":
            return machine.tool.retract_mm * machine.tool.counts_per_mm
        case "spindle":
            return float(machine.spindle.counts_per_rev)
        case _:
            return machine.carriage.jaw_clearance_mm * machine.carriage.counts_per_mm
