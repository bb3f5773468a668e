"""The result of one stop, as entries of a record and as a check against what its settings allow."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.commissioning.amounts import digits, length
from drivers.commissioning.check import Check
from drivers.commissioning.judged import Judged, JudgedAxis
from drivers.commissioning.proofs.air_cut import air_cut
from drivers.commissioning.proofs.bench import proof, stop_name
from drivers.commissioning.stop_record import Origin, StopEntry, Way
from drivers.commissioning.stops import after_abort, after_jog_stop, jog_settings_of
from drivers.lathe.motion import LINK_LATENCY_MS
from drivers.pmac.analysis.units import unit_of
from drivers.pmac.heartbeat.watch import Look, WatchdogProof, proof_problems, rest_s
from drivers.pmac.heartbeat.watchdog import WATCHDOG_MS

MOVED_COUNTS = 1.0
"""An axis that moves less than this after a stop was not moving before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenStop:
    """The polls from just before a stop up to rest.

    `pressed_s` is when it, or the last watchdog renewal, was sent; `late_ms` is how old the first poll was
    then. `as_meant` is whether all came to rest by the intended stop. `lobe` are the two ends of the tool's
    lobe in a cut, counts: between two polls it oscillates, so its distance is counted from the further end.
    """

    way: Way
    pressed_s: float
    late_ms: float
    looks: tuple[Look, ...]
    as_meant: bool
    origin: Origin = Origin.JOG
    lobe: tuple[float, float] | None = None
    watchdog: WatchdogProof | None = None

    def counts(self, axis: JudgedAxis) -> float:
        """Return how far an axis travelled from its position before the stop."""
        if axis.name == "tool" and self.lobe is not None:
            rest = self.looks[-1].positions[axis.motor]
            return max(abs(rest - end) for end in self.lobe)
        begun = self.looks[0].positions[axis.motor]
        return max(abs(look.positions[axis.motor] - begun) for look in self.looks)

    def time_s(self, axis: JudgedAxis) -> float:
        """Return the time to rest, infinite when it did not come to rest."""
        found = rest_s(self.looks, axis.motor)
        return math.inf if found is None else found - self.pressed_s


def stop_entries(judged: Judged, seen: SeenStop) -> tuple[StopEntry, ...]:
    """Return the record entries of a correct stop."""
    return tuple(_entry(judged, axis, seen) for axis in judged.driven_axes)


def stop_checks(judged: Judged, seen: SeenStop) -> Iterator[Check]:
    """Check stopping distances against the computed ones; for the first watchdog timeout, also its delay."""
    if seen.watchdog is not None and seen.origin is Origin.JOG:
        yield _watchdog_check(seen.watchdog)
    machine, found, wanted, holds = judged.machine, [], [], seen.as_meant
    for axis in judged.driven_axes:
        counts = seen.counts(axis)
        bound = bound_counts(judged, axis, seen.way, seen.origin, seen.late_ms)
        time = "∞" if math.isinf(seen.time_s(axis)) else digits(seen.time_s(axis))
        found.append(f"{axis.name} {length(counts, axis.motor, machine)} {time} s")
        if math.isfinite(bound):
            wanted.append(f"{axis.name} <= {length(bound, axis.motor, machine)}")
        holds = holds and MOVED_COUNTS < counts <= bound
    name = stop_name(seen.way, seen.origin)
    yield proof(name, holds=holds, found=", ".join(found), wanted=", ".join(wanted) or "-")


def bound_counts(judged: Judged, axis: JudgedAxis, way: Way, origin: Origin, late_ms: float) -> float:
    """Return the longest stopping distance, counts, infinite where settings do not determine it.

    `late_ms` is the age of the poll from which the distance is counted, when the stop was sent. Coasting after
    a control-K, and the end of a cut without a host, are only measured.
    """
    late_ms += judged.machine.controller.background_ms + LINK_LATENCY_MS
    match way, origin:
        case Way.ABORT, Origin.JOG:
            return after_abort(jog_settings_of(judged, axis).speed, judged.of_motor(axis, 15), late_ms).counts
        case Way.ABORT, Origin.CUT:
            return _of_cut(judged, axis, late_ms)
        case Way.WATCHDOG, Origin.JOG:
            return after_jog_stop(jog_settings_of(judged, axis), WATCHDOG_MS + late_ms).counts
        case _:
            return math.inf


def _of_cut(judged: Judged, axis: JudgedAxis, late_ms: float) -> float:
    """Return the tool's bound in a cut: from one end of its lobe to the other, plus its stopping distance."""
    cut, rate = air_cut(judged.machine), judged.of_motor(axis, 15)
    speed = cut.speeds[axis.name]
    if axis.name == "tool":
        return 2.0 * cut.amplitude + after_abort(speed, rate, 0.0).counts
    return after_abort(speed, rate, late_ms).counts


def _watchdog_check(found: WatchdogProof) -> Check:
    ended = "-" if found.ended_s is None else f"{digits(found.ended_s)} s"
    return proof("lease", holds=not proof_problems(found), found=ended, wanted=f"<= {WATCHDOG_MS / 1000.0:g} s")


def _entry(judged: Judged, axis: JudgedAxis, seen: SeenStop) -> StopEntry:
    unit = unit_of(judged.machine, axis.motor)
    assert unit is not None  # every axis of the machine has one
    distance, speed = seen.counts(axis) * unit.per_count, speed_of(judged, axis, seen.origin) * unit.velocity
    linear = unit.name == "mm"
    return StopEntry(
        way=seen.way,
        origin=seen.origin,
        axis=axis.name,
        time_s=seen.time_s(axis),
        distance_mm=distance if linear else None,
        distance_deg=None if linear else distance,
        speed_mm_per_s=speed if linear else None,
        speed_rpm=None if linear else speed,
    )


def seen_speed(axis: JudgedAxis, earlier: Look, later: Look) -> float:
    """Return the speed between two polls, counts/ms."""
    passed_ms = (later.answered_s - earlier.answered_s) * 1000.0
    return abs(later.positions[axis.motor] - earlier.positions[axis.motor]) / passed_ms


def speed_of(judged: Judged, axis: JudgedAxis, origin: Origin) -> float:
    """Return the speed before the stop, counts/ms; for the tool in a cut, the maximum of its lobe."""
    if origin is Origin.CUT:
        return air_cut(judged.machine).speeds[axis.name]
    return jog_settings_of(judged, axis).speed
