"""What the card watches of one motor in every background cycle, its travel too, read once from its settings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

from drivers.pmac.dialect import Setting
from drivers.pmac.settings import PARTS_PER_COUNT
from drivers.pmac.variables import VariableStore

_NO_TRAVEL_SWITCHES, _NO_FAULT_INPUT = 1 << 17, 1 << 20
"""Bits of the flag mode (Ix25, on a Turbo Ixx24)."""


class Alarm(Enum):
    """Why the card takes a motor out of somebody's hands."""

    FOLLOWING_ERROR = auto()
    AMPLIFIER = auto()
    TRAVEL = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """Limits in counts, infinite where they are switched off; `looks` is what in-position needs beyond one."""

    fatal_error: float
    warning_error: float
    in_position: float
    looks: float
    highest: float
    lowest: float
    switches_used: bool
    fault_used: bool


def read_guard(variables: VariableStore, motor: int) -> Guard:
    """Return what the settings of a motor say now."""
    mode = int(variables.setting(Setting.FLAG_MODE, motor))
    return Guard(
        fatal_error=_or_none(variables.motor(motor, 11)) / PARTS_PER_COUNT,
        warning_error=_or_none(variables.motor(motor, 12)) / PARTS_PER_COUNT,
        in_position=variables.motor(motor, 28) / PARTS_PER_COUNT,
        looks=variables.setting(Setting.IN_POSITION_LOOKS, motor),
        highest=variables.motor(motor, 13) or math.inf,
        lowest=variables.motor(motor, 14) or -math.inf,
        switches_used=not mode & _NO_TRAVEL_SWITCHES,
        fault_used=not mode & _NO_FAULT_INPUT,
    )


def _or_none(limit: float) -> float:
    """0 and less switch a limit of the following error off."""
    return limit if limit > 0.0 else math.inf


def action_on_fault(variables: VariableStore, motor: int) -> int:
    """Return whom a fault of this motor kills: 0 all motors, 1 those of its coordinate system, 2 or 3 itself."""
    return int(variables.setting(Setting.FLAG_MODE, motor)) >> 21 & 3


@dataclass(slots=True)
class TravelLimits:
    """What a motor may no longer do.

    `plus_pin` and `minus_pin` are the inputs +LIM and -LIM, set when the switch is open. Beware: it is the pin
    +LIM that stops travel in the negative direction, and -LIM that stops it in the positive one (PMAC Software
    Reference, Ix25). `positive` and `negative` are what is reported, named after the direction that is barred.
    `stopped` is whether a limit has stopped the motor.
    """

    plus_pin: bool = False
    minus_pin: bool = False
    positive: bool = False
    negative: bool = False
    stopped: bool = False

    @property
    def concerned(self) -> bool:
        """Whether anything is set, so that it has to be looked at even inside Ix13 and Ix14."""
        return self.positive or self.negative or self.plus_pin or self.minus_pin

    def look(self, position: float, highest: float, lowest: float, *, pins_used: bool) -> None:
        """Take note of where the motor is, and how far it may go, in counts."""
        self.positive = (pins_used and self.minus_pin) or position > highest
        self.negative = (pins_used and self.plus_pin) or position < lowest

    def bars(self, direction: float) -> bool:
        """Whether motion in a direction is not allowed now."""
        return (direction > 0.0 and self.positive) or (direction < 0.0 and self.negative)

    def reset(self) -> None:
        """Forget what was seen; the switches stay where they are."""
        self.positive = self.negative = self.stopped = False
