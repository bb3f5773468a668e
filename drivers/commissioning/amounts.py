"""Values of settings as text: in the controller's units, and in those of the machine."""

from __future__ import annotations

from drivers.commissioning.setting_names import Named, Quantity
from drivers.pmac.analysis.units import unit_of
from drivers.pmac.language.text import format_number
from drivers.pmac.settings import PARTS_PER_COUNT
from profiles.machine import MachineProfile

_PLAIN_DIGITS = 1e5


def digits(value: float) -> str:
    """Return a number with five digits, without an exponent; a large one with all digits before the point."""
    if abs(value) >= _PLAIN_DIGITS:
        return f"{value:.0f}"
    short = f"{value:.5g}"
    return format_number(value) if "e" in short else short


def amount(value: float, of: Named, machine: MachineProfile) -> str:
    """Return a value such as `40 counts/ms2 (8000 mm/s2)`."""
    counted, motor = digits(value), of.motor
    match of.name.quantity:
        case Quantity.ADDRESS:
            return f"${int(value):X}" if value == int(value) and value >= 0 else format_number(value)
        case Quantity.NUMBER:
            return format_number(value)
        case Quantity.TIME_MS:
            return f"{counted} ms"
        case Quantity.DAC_BITS:
            unit, converted = "bits", _current(value, motor, machine)
        case Quantity.COUNTS:
            unit, converted = "counts", _length(value, motor, machine)
        case Quantity.SIXTEENTHS:
            unit, converted = "/16 counts", _length(value / PARTS_PER_COUNT, motor, machine)
        case Quantity.SPEED:
            unit, converted = "counts/ms", _speed(value, motor, machine)
        case Quantity.ACCELERATION:
            unit, converted = "counts/ms2", _acceleration(value, motor, machine)
    return f"{counted} {unit} ({converted})" if converted else f"{counted} {unit}"


def length(counts: float, motor: int, machine: MachineProfile) -> str:
    """Return a length or an angle in the unit of its axis, counts where there is none."""
    return _length(counts, motor, machine) or f"{digits(counts)} counts"


def speed(counts_per_ms: float, motor: int, machine: MachineProfile) -> str:
    """Return a speed in the unit of its axis, counts/ms where there is none."""
    return _speed(counts_per_ms, motor, machine) or f"{digits(counts_per_ms)} counts/ms"


def _length(counts: float, motor: int, machine: MachineProfile) -> str:
    unit = unit_of(machine, motor)
    return "" if unit is None else f"{digits(counts * unit.per_count)} {unit.name}"


def _speed(counts_per_ms: float, motor: int, machine: MachineProfile) -> str:
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
