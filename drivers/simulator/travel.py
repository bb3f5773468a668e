"""The travel limits of one motor: the two switches at its ends, and Ix13 and Ix14."""

from __future__ import annotations

from dataclasses import dataclass


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
