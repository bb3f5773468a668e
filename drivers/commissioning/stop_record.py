"""The stopping-performance record, measured on the machine once per settings; `stop_record_check` validates it.

To the controller a cut cable and a killed host (SIGKILL) look the same: the host falls silent and the watchdog
expires. So there are three ways to stop: control-A, control-K, and silence.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from enum import StrEnum

from drivers.commissioning.configuration import digest
from drivers.commissioning.reading import read_ranges
from drivers.controller import Controller
from drivers.link.base import StopWay
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.watchdog import SERVO_PERIOD
from profiles.machine import MachineProfile

MOTION_SETTINGS, FILTER_SETTINGS = range(15, 26), range(30, 36)  # Ix15-25: stops, ramps and flags; Ix30-35: gains
OUTPUT_SETTINGS = range(68, 70)  # Ix68 and Ix69: the available braking force


class Way(StrEnum):
    """How the machine is stopped."""

    ABORT = "abort"  # control-A: every loop stays closed
    KILL = "kill"  # control-K: every loop is opened, the spindle coasts
    WATCHDOG = "lease"  # the host falls silent, and the controller ends the motion by itself


class Origin(StrEnum):
    """The motion before the stop."""

    JOG = "jog"
    CUT = "cut"  # in air, at full speed


@dataclass(frozen=True, slots=True, kw_only=True)
class StopEntry:
    """The distance and time of one axis from the host's last message to rest.

    A linear axis has its distance in mm and its speed in mm/s, the spindle in deg and rpm; the others are None.
    """

    way: Way
    origin: Origin
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


def needed_stops(machine: MachineProfile) -> frozenset[tuple[Way, Origin, str]]:
    """Return the stops of a complete record.

    A spindle on an inverter is never closed, so control-A does not stop such a machine; it is switched off at
    the lathe.
    """
    followed = machine.spindle.followed
    ways = (Way.KILL, Way.WATCHDOG) if followed else tuple(Way)
    axes = ("tool", "carriage") if followed else ("tool", "spindle", "carriage")
    return frozenset((way, origin, axis) for way in ways for origin in Origin for axis in axes)


def stop_key(client: Controller, machine: MachineProfile, dialect: Dialect) -> str:
    """Read the settings that determine how the machine stops, and return their hash.

    Raises DriverError: the link broke, or the controller answers something unexpected.
    """
    kind, version = client.query("TYPE", "VERSION", again=True)
    blocks = [
        range(dialect.motor_index(motor, part.start), dialect.motor_index(motor, part.stop))
        for motor in (machine.tool.motor, machine.spindle.motor, machine.carriage.motor)
        for part in (MOTION_SETTINGS, FILTER_SETTINGS, OUTPUT_SETTINGS)
    ]
    settings = read_ranges(client, dialect, [range(SERVO_PERIOD, SERVO_PERIOD + 1), *blocks])
    lines = [f"I{index}={value!r}" for index, value in sorted(settings.items())]
    lines.append(f"{machine.heartbeat.policy} {machine.heartbeat.grace_ms!r}")
    return digest([machine.name, kind.strip(), version.strip(), *lines])
