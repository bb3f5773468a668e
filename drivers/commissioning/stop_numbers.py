"""Check whether a measured stop is plausible: its times, distances and speeds against the machine's limits.

A stop takes time, and nothing travels further in that time than its speed allows. Impossible numbers were not
measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from drivers.commissioning.stop_record import Origin, StopEntry, Way
from drivers.pmac.motor_settings import MotorSettings
from profiles.machine import MachineProfile
from profiles.problem import Problem

LATE_S = 0.5
"""The distance is counted from the last poll before the stop, which is no older than this on the slowest line."""

FASTER = 1.1
"""Factor by which an axis may exceed its set speed: ripple, and the 10 % uncertainty of two polls."""

LONGEST_S = {Way.ABORT: 20.0, Way.KILL: 70.0, Way.WATCHDOG: 20.0}
"""Longest possible waits for rest (`REST_LIMIT_S` of the tests, plus the time until the stop is obeyed)."""

LINEAR, ROTARY = ("distance_mm", "speed_mm_per_s"), ("distance_deg", "speed_rpm")
DEG_PER_S_OF_RPM = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Axis:
    """Minimum and maximum distance, mm or deg, and maximum speed, mm/s or deg/s, of an axis of this machine."""

    unit: str
    least: float
    most: float
    fastest: float


def number_problems(entries: Iterable[StopEntry], machine: MachineProfile) -> Iterator[Problem]:
    """Yield `stops.impossible` for each impossible entry, with the first reason."""
    seen: set[tuple[Way, Origin, str]] = set()
    for entry in entries:
        name = (entry.way, entry.origin, entry.axis)
        reason = ("2 x", "1 x") if name in seen else _reason(entry, machine)
        seen.add(name)
        if reason is not None:
            value = f"{' '.join(name)}: {reason[0]}"
            yield Problem(code="stops.impossible", key=machine.name, value=value, limit=reason[1])


def _reason(entry: StopEntry, machine: MachineProfile) -> tuple[str, str] | None:
    """Return what is wrong with an entry, and what is allowed; None where nothing is."""
    longest_s = LONGEST_S[entry.way]
    if not 0.0 < entry.time_s <= longest_s:
        return f"{entry.time_s:g} s", f"> 0, <= {longest_s:g} s"
    axis = _axis(entry.axis, machine)
    if axis is None:
        return entry.axis, "tool | spindle | carriage"
    own, others = (LINEAR, ROTARY) if axis.unit == "mm" else (ROTARY, LINEAR)
    way, speed = (getattr(entry, key) for key in own)
    if way is None or speed is None or any(getattr(entry, key) is not None for key in others):
        return "-", ", ".join(own)
    speed *= DEG_PER_S_OF_RPM if axis.unit == "deg" else 1.0
    if not 0.0 < speed <= FASTER * axis.fastest:
        return f"{speed:g} {axis.unit}/s", f"> 0, <= {FASTER * axis.fastest:g} {axis.unit}/s"
    # Without its host the cutting program retracts the tool, faster than the tool follows its lobe.
    fastest = axis.fastest if entry.axis == "tool" and entry.origin is Origin.CUT else speed
    most = min(axis.most, FASTER * fastest * (entry.time_s + LATE_S))
    if not axis.least <= way <= most:
        return f"{way:g} {axis.unit}", f">= {axis.least:g}, <= {most:g} {axis.unit}"
    return None


def _axis(name: str, machine: MachineProfile) -> _Axis | None:
    match name:
        case "tool" | "carriage":
            linear = machine.tool if name == "tool" else machine.carriage
            settings = MotorSettings(machine, linear.motor)
            return _Axis(
                unit="mm",
                least=1.0 / linear.counts_per_mm,
                most=linear.travel_max_mm - linear.travel_min_mm,
                fastest=max(abs(settings.program_speed), settings.jog_speed),
            )
        case "spindle":
            spindle = machine.spindle
            fastest = DEG_PER_S_OF_RPM * spindle.max_speed_rpm
            return _Axis(unit="deg", least=360.0 / spindle.counts_per_rev, most=math.inf, fastest=fastest)
        case _:
            return None
