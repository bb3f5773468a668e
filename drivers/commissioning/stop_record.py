"""The stopping-performance record, measured on the machine once per settings, and its validation.

To the controller a cut cable and a killed host (SIGKILL) look the same: the host falls silent and the watchdog
expires. So there are three ways to stop: control-A, control-K, and silence.

A valid record is of this machine at this link, complete, plausible, and recent. A stop takes time, and nothing
travels further in that time than its speed allows: impossible numbers were not measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date
from enum import StrEnum

from drivers.commissioning.configuration import digest
from drivers.commissioning.reading import read_ranges
from drivers.controller import Controller
from drivers.link.address import without_options
from drivers.link.base import StopWay
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.watchdog import SERVO_PERIOD
from drivers.pmac.motor_settings import MotorSettings
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import Problem

MOTION_SETTINGS, FILTER_SETTINGS = range(15, 26), range(30, 36)  # Ix15-25: stops, ramps and flags; Ix30-35: gains
OUTPUT_SETTINGS = range(68, 70)  # Ix68 and Ix69: the available braking force


class StopMethod(StrEnum):
    """How the machine is stopped."""

    ABORT = "abort"  # control-A: every loop stays closed
    KILL = "kill"  # control-K: every loop is opened, the spindle coasts
    WATCHDOG = "lease"  # the host falls silent, and the controller ends the motion by itself


class PriorMotion(StrEnum):
    """The motion before the stop."""

    JOG = "jog"
    CUT = "cut"  # in air, at full speed


@dataclass(frozen=True, slots=True, kw_only=True)
class StopEntry:
    """The distance and time of one axis from the host's last message to rest.

    A linear axis has its distance in mm and its speed in mm/s, the spindle in deg and rpm; the others are None.
    """

    way: StopMethod
    origin: PriorMotion
    axis: str
    time_s: float
    distance_mm: float | None = None
    distance_deg: float | None = None
    speed_mm_per_s: float | None = None
    speed_rpm: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRecord:
    """The entries of one machine. `kind` and `version` are its controller's; `key` is its `stop_key`.

    `address` is the link that it was measured over, and `stop_way` the path of the stops. `tests` are the
    commissioning tests that passed then.
    """

    machine: str
    kind: str
    version: str
    key: str
    measured_at: date
    address: str
    stop_way: StopWay
    entries: tuple[StopEntry, ...]
    tests: tuple[str, ...] = ()


def needed_stops(machine: MachineProfile) -> frozenset[tuple[StopMethod, PriorMotion, str]]:
    """Return the stops of a complete record.

    A spindle on an inverter is never closed, so control-A does not stop such a machine; it is switched off at
    the lathe.
    """
    followed = machine.spindle.followed
    ways = (StopMethod.KILL, StopMethod.WATCHDOG) if followed else tuple(StopMethod)
    axes = ("tool", "carriage") if followed else ("tool", "spindle", "carriage")
    return frozenset((way, origin, axis) for way in ways for origin in PriorMotion for axis in axes)


def stop_key(client: Controller, machine: MachineProfile, dialect: Dialect) -> str:
    """Read the settings that determine how the machine stops, and return their hash.

    Raises DriverError: the link broke, or the controller answers something unexpected.
    """
    kind, version = client.query("TYPE", "VERSION", again=True)
    blocks = [
        range(dialect.motor_index(motor, part.start), dialect.motor_index(motor, part.stop))
        for motor in machine.motors
        for part in (MOTION_SETTINGS, FILTER_SETTINGS, OUTPUT_SETTINGS)
    ]
    settings = read_ranges(client, dialect, [range(SERVO_PERIOD, SERVO_PERIOD + 1), *blocks])
    lines = [f"I{index}={value!r}" for index, value in sorted(settings.items())]
    lines.append(f"{machine.heartbeat.policy} {machine.heartbeat.grace_ms!r}")
    return digest([machine.name, kind.strip(), version.strip(), *lines])


VALID_DAYS = 180  # drives, brakes and friction change; half a year is a usual inspection interval
LATE_S = 0.5  # age of the last poll before a stop, from which its distance counts, on the slowest line
FASTER = 1.1  # factor by which an axis may exceed its set speed: ripple, and the 10 % uncertainty of two polls
LONGEST_S = {StopMethod.ABORT: 20.0, StopMethod.KILL: 70.0, StopMethod.WATCHDOG: 20.0}
"""Longest possible waits for rest (`REST_LIMIT_S` of the tests, plus the time until the stop is obeyed)."""

LINEAR, ROTARY = ("distance_mm", "speed_mm_per_s"), ("distance_deg", "speed_rpm")
DEG_PER_S_OF_RPM = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StopsNow:
    """What a record must match: this machine with the settings of `key` (`stop_key`), today.

    `stop_way` is the path of a stop now. `address` is that of the link; None for a simulated machine,
    which is measured on a copy of itself.
    """

    machine: MachineProfile
    key: str
    today: date
    stop_way: StopWay
    address: str | None


def record_problems(record: StopRecord | None, now: StopsNow) -> tuple[Problem, ...]:
    """Return why a record does not permit arming.

    It is missing; of another machine, link or settings; too old or dated in the future; incomplete; or contains
    stops that this machine cannot have made.
    """
    if record is None:
        return (Problem(code="stops.no_record"),)
    return (*_of_another(record, now), *_of_other_times(record, now), *_measured(record, now))


def _of_another(record: StopRecord, now: StopsNow) -> Iterator[Problem]:
    name = now.machine.name
    if record.machine != name:
        yield Problem(code="stops.other_machine", key=name, value=printable(record.machine, 60), limit=name)
    if now.address is not None and without_options(record.address) != without_options(now.address):
        value = printable(record.address, 60)
        yield Problem(code="stops.other_address", key=name, value=value, limit=now.address)


def _of_other_times(record: StopRecord, now: StopsNow) -> Iterator[Problem]:
    measured_at, age_days = record.measured_at.isoformat(), (now.today - record.measured_at).days
    if age_days < 0:
        yield Problem(code="stops.in_future", value=measured_at, limit=now.today.isoformat())
    elif age_days > VALID_DAYS:
        yield Problem(code="stops.expired", value=measured_at, limit=f"<= {VALID_DAYS} d")
    if record.key != now.key:
        yield Problem(code="stops.other_settings", value=record.key[:12], limit=now.key[:12])
    if now.stop_way not in (record.stop_way, StopWay.LOST):
        yield Problem(code="stops.other_way", value=record.stop_way, limit=now.stop_way)


def _measured(record: StopRecord, now: StopsNow) -> Iterator[Problem]:
    missing = needed_stops(now.machine) - {(entry.way, entry.origin, entry.axis) for entry in record.entries}
    if missing:
        yield Problem(code="stops.incomplete", value=", ".join(sorted(" ".join(each) for each in missing)))
    yield from _number_problems(record.entries, now.machine)


def _number_problems(entries: Iterable[StopEntry], machine: MachineProfile) -> Iterator[Problem]:
    seen: set[tuple[StopMethod, PriorMotion, str]] = set()
    for entry in entries:
        name = (entry.way, entry.origin, entry.axis)
        reason = ("2 x", "1 x") if name in seen else _reason(entry, machine)
        seen.add(name)
        if reason is not None:
            value = f"{' '.join(name)}: {reason[0]}"
            yield Problem(code="stops.impossible", key=machine.name, value=value, limit=reason[1])


def _reason(entry: StopEntry, machine: MachineProfile) -> tuple[str, str] | None:
    """Return the fault of an entry with the limit, None if it is sound."""
    longest_s = LONGEST_S[entry.way]
    if not 0.0 < entry.time_s <= longest_s:
        return f"{entry.time_s:g} s", f"> 0, <= {longest_s:g} s"
    bounds = _bounds(entry.axis, machine)
    if bounds is None:
        return entry.axis, "tool | spindle | carriage"
    unit, least, most, fastest = bounds
    own, others = (LINEAR, ROTARY) if unit == "mm" else (ROTARY, LINEAR)
    way, speed = (getattr(entry, key) for key in own)
    if way is None or speed is None or any(getattr(entry, key) is not None for key in others):
        return "-", ", ".join(own)
    speed *= DEG_PER_S_OF_RPM if unit == "deg" else 1.0
    if not 0.0 < speed <= FASTER * fastest:
        return f"{speed:g} {unit}/s", f"> 0, <= {FASTER * fastest:g} {unit}/s"
    # Without its host the cutting program retracts the tool, faster than the tool follows its lobe.
    meanwhile = fastest if entry.axis == "tool" and entry.origin is PriorMotion.CUT else speed
    most = min(most, FASTER * meanwhile * (entry.time_s + LATE_S))
    if not least <= way <= most:
        return f"{way:g} {unit}", f">= {least:g}, <= {most:g} {unit}"
    return None


def _bounds(name: str, machine: MachineProfile) -> tuple[str, float, float, float] | None:
    """Return unit, minimum and maximum distance (mm, deg), and maximum speed (mm/s, deg/s) of an axis."""
    if name == "spindle":
        spindle = machine.spindle
        return "deg", 360.0 / spindle.counts_per_rev, math.inf, DEG_PER_S_OF_RPM * spindle.max_speed_rpm
    if name not in ("tool", "carriage"):
        return None
    linear = machine.tool if name == "tool" else machine.carriage
    settings = MotorSettings(machine, linear.motor)
    fastest = max(abs(settings.program_speed), settings.jog_speed)
    return "mm", 1.0 / linear.counts_per_mm, linear.travel_max_mm - linear.travel_min_mm, fastest
