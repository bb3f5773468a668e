"""A configuration together with the machine profile by which it is judged."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from drivers.commissioning.check import Check, Group
from drivers.commissioning.configuration import ControllerConfiguration, passing_settings
from drivers.commissioning.setting_names import NamedSetting, SettingQuantity, name_setting
from drivers.pmac.analysis.units import unit_of
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_number
from drivers.pmac.settings import PARTS_PER_COUNT, named_settings
from profiles.axis.servo_gains import stated_settings
from profiles.findings import Severity
from profiles.machine import MachineProfile

SAME = 1e-6  # relative tolerance for equal numbers: a controller has fewer digits than a host
_PLAIN_DIGITS = 1e5


@dataclass(frozen=True, slots=True)
class JudgedAxis:
    """An axis of the machine, its motor, and the group of its checks."""

    name: str
    motor: int
    group: Group


def digits(value: float) -> str:
    """Return a number with five digits, without an exponent; a large one with all digits before the point."""
    if abs(value) >= _PLAIN_DIGITS:
        return f"{value:.0f}"
    short = f"{value:.5g}"
    return format_number(value) if "e" in short else short


def amount(value: float, of: NamedSetting, machine: MachineProfile) -> str:
    """Return a value such as `40 counts/ms2 (8000 mm/s2)`."""
    counted, motor = digits(value), of.motor
    match of.name.quantity:
        case SettingQuantity.ADDRESS:
            return f"${int(value):X}" if value == int(value) and value >= 0 else format_number(value)
        case SettingQuantity.NUMBER:
            return format_number(value)
        case SettingQuantity.TIME_MS:
            return f"{counted} ms"
        case SettingQuantity.DAC_BITS:
            unit, converted = "bits", _current(value, motor, machine)
        case SettingQuantity.COUNTS:
            unit, converted = "counts", _length(value, motor, machine)
        case SettingQuantity.SIXTEENTHS:
            unit, converted = "/16 counts", _length(value / PARTS_PER_COUNT, motor, machine)
        case SettingQuantity.SPEED:
            unit, converted = "counts/ms", _format_speed(value, motor, machine)
        case SettingQuantity.ACCELERATION:
            unit, converted = "counts/ms2", _acceleration(value, motor, machine)
    return f"{counted} {unit} ({converted})" if converted else f"{counted} {unit}"


def length(counts: float, motor: int, machine: MachineProfile) -> str:
    """Return a length or an angle in the unit of its axis, counts without one."""
    return _length(counts, motor, machine) or f"{digits(counts)} counts"


def speed(counts_per_ms: float, motor: int, machine: MachineProfile) -> str:
    """Return a speed in the unit of its axis, counts/ms without one."""
    return _format_speed(counts_per_ms, motor, machine) or f"{digits(counts_per_ms)} counts/ms"


def _length(counts: float, motor: int, machine: MachineProfile) -> str:
    unit = unit_of(machine, motor)
    return "" if unit is None else f"{digits(counts * unit.per_count)} {unit.name}"


def _format_speed(counts_per_ms: float, motor: int, machine: MachineProfile) -> str:
    unit = unit_of(machine, motor)
    return "" if unit is None else f"{digits(counts_per_ms * unit.velocity)} {unit.velocity_unit}"


def _acceleration(counts_per_ms2: float, motor: int, machine: MachineProfile) -> str:
    """Return the acceleration per second, in the unit of the speed: mm/s2 and rpm/s."""
    unit = unit_of(machine, motor)
    if unit is None:
        return ""
    per_second = "mm/s2" if unit.name == "mm" else f"{unit.velocity_unit}/s"
    return f"{digits(counts_per_ms2 * 1e3 * unit.velocity)} {per_second}"


def _current(bits: float, motor: int, machine: MachineProfile) -> str:
    tool = machine.tool
    current_a = bits * tool.v_per_bit * tool.amplifier_gain_a_per_v
    return f"{digits(current_a)} A" if motor == tool.motor else ""


@dataclass(frozen=True, kw_only=True)
class CheckedConfiguration:
    """The settings read, and their wanted values."""

    configuration: ControllerConfiguration
    machine: MachineProfile

    @property
    def dialect(self) -> Dialect:
        """The family that was read."""
        return self.configuration.dialect

    @cached_property
    def stated_settings(self) -> Mapping[int, float]:
        """The settings stated by the profile, except those that ordinary work changes."""
        return stated_settings_of(self.machine, self.dialect)

    @property
    def axes(self) -> tuple[JudgedAxis, ...]:
        """The axes of the machine."""
        machine = self.machine
        return (
            JudgedAxis("tool", machine.tool.motor, Group.TOOL),
            JudgedAxis("spindle", machine.spindle.motor, Group.SPINDLE),
            JudgedAxis("carriage", machine.carriage.motor, Group.CARRIAGE),
        )

    @property
    def driven_axes(self) -> tuple[JudgedAxis, ...]:
        """The axes that the controller moves: a spindle on an inverter is only read."""
        followed = self.machine.spindle.followed
        return tuple(axis for axis in self.axes if not (followed and axis.name == "spindle"))

    def value(self, index: int) -> float | None:
        """Return a setting, None if the controller lacks that number."""
        return self.configuration.settings.get(index)

    def of_motor(self, axis: JudgedAxis, number: int) -> float:
        """Return Ix`number` of an axis; 0 where the controller has none."""
        return self.configuration.settings.get(self.dialect.motor_index(axis.motor, number), 0.0)

    def of_system(self, number: int) -> float:
        """Return Ix`number` of coordinate system 1; 0 where the controller has none."""
        return self.configuration.settings.get(self.dialect.system_index(1, number), 0.0)

    def place_of(self, of: NamedSetting) -> tuple[Group, str]:
        """Return the group of a setting's checks, and what the setting belongs to."""
        if of.system:
            return Group.SYSTEM, f"system {of.system}"
        if not of.motor:
            return Group.CARD, ""
        axis = next((axis for axis in self.axes if axis.motor == of.motor), None)
        return (Group.CARD, f"motor {of.motor}") if axis is None else (axis.group, axis.name)

    def about(
        self, code: str, severity: Severity, index: int, wanted: str = "", facts: Mapping[str, str] | None = None
    ) -> Check:
        """Return a check about one setting, with its value as text."""
        of, value = name_setting(index, self.dialect), self.value(index)
        group, subject = self.place_of(of)
        return Check(
            group,
            code,
            severity,
            subject=subject,
            setting=of.name.key,
            variable=f"I{index}",
            found="-" if value is None else amount(value, of, self.machine),
            wanted=wanted,
            facts={"nature": of.name.nature.value, **(facts or {})},
        )


def differing_settings(machine: MachineProfile, found: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return the settings that differ from the profile, by name: stated and found value."""
    stated = stated_settings(machine)
    both = {name: (stated[name], value) for name, value in found.items() if name in stated}
    return {name: (wanted, value) for name, (wanted, value) in both.items() if not is_same_number(wanted, value)}


def stated_settings_of(machine: MachineProfile, dialect: Dialect) -> Mapping[int, float]:
    """Return the settings that a profile states, by number, without those that ordinary work changes.

    A notch filter of the tool of which it says nothing is none, since a cut inverts the loop without it.
    """
    passing, stated = passing_settings(dialect), named_settings(stated_settings(machine), dialect)
    return {index: value for index, value in sorted(stated.items()) if index not in passing}


def is_same_number(first: float, second: float) -> bool:
    """Whether two numbers are equal within the controller's precision; whole numbers are exact."""
    if first % 1.0 == 0.0 and second % 1.0 == 0.0:
        return first == second
    return math.isclose(first, second, rel_tol=SAME, abs_tol=SAME)
