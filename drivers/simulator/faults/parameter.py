"""The parameters of a fault: a value with a unit, a default and a range, and how it is parsed from text."""

from __future__ import annotations

import math
import re
from dataclasses import KW_ONLY, dataclass
from typing import TypeAlias

from drivers.errors import RefusedError
from profiles.problem import Problem

Value: TypeAlias = float | str
MOST_SHOWN = 80  # maximum characters of a refused value that are reported
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number from `least` to `most`, one of `choices`, or with neither a text.

    Without a `default` it is optional; `meaning` describes the effect of omitting it. With `above_least`, `least`
    itself is not allowed.
    """

    name: str
    meaning: str
    _: KW_ONLY
    unit: str = ""
    default: Value | None = None
    least: float = -math.inf
    most: float = math.inf
    above_least: bool = False
    whole: bool = False
    choices: tuple[str, ...] = ()
    text: bool = False

    @property
    def allowed(self) -> str:
        """The range in words."""
        if self.choices:
            return " | ".join(self.choices)
        if self.text:
            return "a line of printable characters"
        bounds = f"{self.least:g} {'<' if self.above_least else '<='} {self.name}"
        bounds += f" <= {self.most:g}" if math.isfinite(self.most) else ""
        return f"{bounds}, whole" if self.whole else bounds

    def check(self, value: Value, fault: str) -> Value:
        """Return a value that is allowed, a number as `float`.

        Raises RefusedError: `simulator.fault`, it is not.
        """
        fits = self._word(value) if self.text or self.choices else self._number(value)
        if fits is None:
            raise refusal(fault, self.name, _shown(value), self.allowed)
        return fits

    def _word(self, value: Value) -> str | None:
        if not isinstance(value, str) or (self.choices and value not in self.choices):
            return None
        return value if value and value.isascii() and value.isprintable() else None

    def _number(self, value: object) -> float | None:
        """Parse a number, or ASCII digits; a caller may pass anything."""
        if isinstance(value, str):
            if _NUMBER.fullmatch(value) is None:
                return None
        elif isinstance(value, bool) or not isinstance(value, int | float):
            return None
        try:
            number = float(value)
        except OverflowError:
            return None
        low_enough = number > self.least if self.above_least else number >= self.least
        fits = math.isfinite(number) and low_enough and number <= self.most
        return number if fits and not (self.whole and number != int(number)) else None


def refusal(fault: str, key: str, value: str, limit: str) -> RefusedError:
    """Return the refusal of a fault: the requested and the allowed values."""
    return RefusedError(Problem(code="simulator.fault", where=fault, key=key, value=value, limit=limit))


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, int) and abs(value) >= 10**MOST_SHOWN:
        return "an integer that is too large"  # Python formats none of more than 4300 digits
    shown = ascii(str(value))[1:-1]
    return shown if len(shown) <= MOST_SHOWN else f"{shown[:MOST_SHOWN]}..."
