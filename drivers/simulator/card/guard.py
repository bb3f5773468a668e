"""The monitoring of one motor in every background cycle, including its travel limits, with its settings cached."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

from drivers.pmac.dialect import FamilySetting
from drivers.pmac.settings import PARTS_PER_COUNT
from drivers.pmac.variables import VariableStore

_NO_TRAVEL_SWITCHES, _NO_FAULT_INPUT = 1 << 17, 1 << 20  # bits of the flag mode (Ix25, on a Turbo Ixx24)


class MotorFault(Enum):
    """Why the controller stops a motor by itself."""

    FOLLOWING_ERROR = auto()
    AMPLIFIER = auto()
    TRAVEL = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """Limits in counts, infinite where they are disabled; `polls`: additional ones required for in-position."""

    fatal_error: float
    warning_error: float
    in_position: float
    polls: float
    highest: float
    lowest: float
    switches_used: bool
    fault_used: bool


def read_guard(variables: VariableStore, motor: int) -> Guard:
    """Return the present settings of a motor."""
    mode = int(variables.setting(FamilySetting.FLAG_MODE, motor))
    return Guard(
        fatal_error=_or_none(variables.motor(motor, 11)) / PARTS_PER_COUNT,
        warning_error=_or_none(variables.motor(motor, 12)) / PARTS_PER_COUNT,
        in_position=variables.motor(motor, 28) / PARTS_PER_COUNT,
        polls=variables.setting(FamilySetting.IN_POSITION_LOOKS, motor),
        highest=variables.motor(motor, 13) or math.inf,
        lowest=variables.motor(motor, 14) or -math.inf,
        switches_used=not mode & _NO_TRAVEL_SWITCHES,
        fault_used=not mode & _NO_FAULT_INPUT,
    )


def _or_none(limit: float) -> float:
    """0 and less disable a limit of the following error."""
    return limit if limit > 0.0 else math.inf


def action_on_fault(variables: VariableStore, motor: int) -> int:
    """Return which motors a fault of this one kills: 0 all, 1 those of its coordinate system, 2 or 3 itself."""
    return int(variables.setting(FamilySetting.FLAG_MODE, motor)) >> 21 & 3


@dataclass(slots=True)
class TravelLimits:
    """State of a motor's travel limits.

    `plus_pin` and `minus_pin` are the inputs +LIM and -LIM, set when the switch is open. Beware: it is the pin
    +LIM that stops travel in the negative direction, and -LIM that stops it in the positive one (PMAC Software
    Reference, Ix25). `positive` and `negative` are the reported limits, named after the blocked direction.
    `stopped` is whether a limit has stopped the motor.
    """

    plus_pin: bool = False
    minus_pin: bool = False
    positive: bool = False
    negative: bool = False
    stopped: bool = False

    def sample(self, position: float, highest: float, lowest: float, *, pins_used: bool) -> None:
        """Record the motor's position and its travel range, in counts."""
        self.positive = (pins_used and self.minus_pin) or position > highest
        self.negative = (pins_used and self.plus_pin) or position < lowest

    def bars(self, direction: float) -> bool:
        """Whether motion in a direction is blocked now."""
        return (direction > 0.0 and self.positive) or (direction < 0.0 and self.negative)
