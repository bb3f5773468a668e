"""What a scope gathers: channels of the machine in SI units, period, length and trigger. Pure; light to import."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from drivers.pmac.dialect import Dialect
from profiles.machine import MachineProfile

MOST_LONG_WORDS = 30_000  # a minute and more of fetching on a serial line; a controller has more memory
FETCH_WORDS_REST, FETCH_WORDS_MOTION, LEAST_WORDS = 256, 24, 4

PERIODS_CYCLES = (1, 2, 5, 10, 20, 50, 100)
LENGTHS_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
MOST_CHANNELS = 6


class Axis(StrEnum):
    """Axes of the machine, in the words of its profile."""

    TOOL = "tool"
    SPINDLE = "spindle"
    CARRIAGE = "carriage"


class Quantity(StrEnum):
    """Registers of a motor that can be gathered, by the names of the families' tables."""

    COMMANDED = "commanded"
    ACTUAL = "actual"
    FOLLOWING_ERROR = "following_error"
    VELOCITY = "velocity"
    OUTPUT = "output"
    """What the servo commands the amplifier to give: a voltage. The current itself is not gathered."""


class Trigger(StrEnum):
    """When the record begins."""

    NOW = "now"
    CUT = "cut"
    RISING = "rising"
    FALLING = "falling"


@dataclass(frozen=True, slots=True, order=True)
class Channel:
    """One register of one axis; `key` is its name in files."""

    axis: Axis
    quantity: Quantity

    @property
    def key(self) -> str:
        """Its name, such as `tool.actual`."""
        return f"{self.axis}.{self.quantity}"

    @property
    def si_unit(self) -> str:
        """Its unit in files."""
        if self.quantity is Quantity.OUTPUT:
            return "V"
        unit = "rad" if self.axis is Axis.SPINDLE else "m"
        return f"{unit}/s" if self.quantity is Quantity.VELOCITY else unit


CHANNELS = tuple(
    Channel(axis, quantity)
    for axis, quantities in (
        (Axis.TOOL, tuple(Quantity)),
        (Axis.SPINDLE, (Quantity.ACTUAL, Quantity.FOLLOWING_ERROR, Quantity.VELOCITY)),
        (Axis.CARRIAGE, (Quantity.ACTUAL, Quantity.FOLLOWING_ERROR, Quantity.VELOCITY)),
    )
    for quantity in quantities
)
ANGLE = Channel(Axis.SPINDLE, Quantity.ACTUAL)


def channel_of(key: str) -> Channel:
    """Return a channel by its name. Raises ValueError: there is none."""
    return next((each for each in CHANNELS if each.key == key), None) or _none(key)


def _none(key: str) -> Channel:
    raise ValueError(f"no channel {key!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ScopeSetup:
    """What is gathered. `level` is in the display unit of `level_of`, for a trigger on a level."""

    channels: tuple[Channel, ...] = (
        Channel(Axis.TOOL, Quantity.COMMANDED),
        Channel(Axis.TOOL, Quantity.ACTUAL),
        Channel(Axis.TOOL, Quantity.FOLLOWING_ERROR),
        ANGLE,
    )
    period_cycles: int = 2
    length_s: float = 0.5
    trigger: Trigger = Trigger.NOW
    level: float = 0.0
    level_of: Channel = Channel(Axis.TOOL, Quantity.FOLLOWING_ERROR)

    def samples(self, cycle_ms: float) -> int:
        """Return the number of samples."""
        return max(2, round(self.length_s * 1000.0 / (self.period_cycles * cycle_ms)) + 1)

    def long_words(self, cycle_ms: float, dialect: Dialect) -> int:
        """Return the room that the record takes in the controller."""
        words = sum(1 if dialect.registers[each.quantity].space in "XY" else 2 for each in self.channels)
        return self.samples(cycle_ms) * ((words + 1) // 2)


def motor_of(axis: Axis, machine: MachineProfile) -> int:
    """Return the number of the motor of an axis."""
    motors = {Axis.TOOL: machine.tool.motor, Axis.SPINDLE: machine.spindle.motor}
    return motors.get(axis, machine.carriage.motor)


def si_per_count(channel: Channel, machine: MachineProfile) -> float:
    """Return metres or radians per count of the encoder of an axis, or volts per bit of the output."""
    if channel.quantity is Quantity.OUTPUT:
        return machine.tool.v_per_bit
    if channel.axis is Axis.SPINDLE:
        return 6.283185307179586 / machine.spindle.counts_per_rev
    axis = machine.tool if channel.axis is Axis.TOOL else machine.carriage
    return 1e-3 / axis.counts_per_mm


_DISPLAY = {  # unit, and how many of it are one SI unit
    (False, Quantity.COMMANDED): ("mm", 1e3),
    (False, Quantity.ACTUAL): ("mm", 1e3),
    (False, Quantity.FOLLOWING_ERROR): ("um", 1e6),
    (False, Quantity.VELOCITY): ("mm/s", 1e3),
    (False, Quantity.OUTPUT): ("V", 1.0),
    (True, Quantity.ACTUAL): ("°", 57.29577951308232),
    (True, Quantity.FOLLOWING_ERROR): ("°", 57.29577951308232),
    (True, Quantity.VELOCITY): ("rpm", 9.549296585513721),
}


def display_of(channel: Channel) -> tuple[str, float]:
    """Return the unit in which a channel is shown, and how many of it are one SI unit."""
    return _DISPLAY[channel.axis is Axis.SPINDLE, channel.quantity]
