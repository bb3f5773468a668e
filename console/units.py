"""Lengths as the screens show them, in millimetres or in inches: a choice of display, and nothing else.

Every value in the code is in mm or um, as its name says. Only what is shown is converted, here, once. Inches have
so many decimals that nothing is lost that millimetres show: 0.001 mm is shown to 0.00001 in, 0.1 um to 1 uin. What
is um becomes millionths of an inch (uin), the unit of roundness in an inch shop: ten-thousandths are too coarse.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal

UNITS = ("mm", "inch")
"""The systems to choose from, the built-in one first."""

MOST_EXACT_DECIMALS = 8  # an inch with so many decimals was typed; more are those of a quotient


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shown:
    """How one of our units is shown: `size` of the shown unit in ours, and the `more` decimals that it takes."""

    name: str
    size: Decimal
    more: int


_INCH = {
    "mm": _Shown(name="in", size=Decimal("25.4"), more=2),
    "mm/s": _Shown(name="in/s", size=Decimal("25.4"), more=2),
    "mm/rev": _Shown(name="in/rev", size=Decimal("25.4"), more=2),
    "um": _Shown(name="uin", size=Decimal("0.0254"), more=-1),
}
_SAME = _Shown(name="", size=Decimal(1), more=0)

_NUMBER = r"[+-]?\d+(?:\.\d+)?"
_LENGTH = re.compile(rf"(?<![\w.])({_NUMBER})(?:( (?:…|±|/|to) )({_NUMBER}))? (mm/s|mm/rev|mm|um)(?![\w/])")


@dataclass(frozen=True, slots=True)
class Units:
    """One system of units, `name` in `UNITS`. Units that are no lengths stay as they are."""

    name: str = UNITS[0]

    @property
    def is_inch(self) -> bool:
        """Whether lengths are shown in inches."""
        return self.name == "inch"

    def unit(self, unit: str) -> str:
        """Return the name under which one of our units ("mm", "um", "mm/s", "mm/rev") is shown."""
        return self._display_unit(unit).name or unit

    def size(self, unit: str) -> float:
        """Return how large the shown unit is in ours: 25.4 for "mm" in inches, else 1."""
        return float(self._display_unit(unit).size)

    def figure(self, value: float, unit: str, decimals: int, sign: str = "") -> str:
        """Return a value of our unit as a number of the shown one; `decimals` are those of our unit.

        `sign` is a sign of a format specification, such as "+z".
        """
        shown = self._display_unit(unit)
        return f"{value / float(shown.size):{sign}.{max(decimals + shown.more, 0)}f}"

    def show(self, value: float, unit: str, decimals: int, sign: str = "") -> str:
        """Return a value of our unit as it is shown, with its unit."""
        return f"{self.figure(value, unit, decimals, sign)} {self.unit(unit)}"

    def format_short(self, value: float, unit: str) -> str:
        """Return a value as a number without needless zeros, for a limit or a scale."""
        return f"{value:g}" if self._display_unit(unit) is _SAME else f"{value / self.size(unit):.5g}"

    def exact(self, value: float, unit: str, decimals: int) -> str:
        """Return a number with these decimals of our unit, or with more where rounding would change it.

        A quotient without end has the decimals that lose nothing; what was typed in inches has those typed.
        """
        shown = self._display_unit(unit)
        decimals = max(decimals + shown.more, 0)
        quotient = Decimal(repr(value)) / shown.size
        text = f"{quotient:.{decimals}f}"
        most = math.inf if shown is _SAME else MOST_EXACT_DECIMALS
        ends = -int(quotient.normalize().as_tuple().exponent) <= most
        return text if Decimal(text) == quotient or not ends else format(quotient.normalize(), "f")

    def format_limit(self, value: float, unit: str, *, upper: bool) -> str:
        """Return a limit as a number that is itself within: an upper one rounded down, a lower one up."""
        shown = self._display_unit(unit)
        if shown is _SAME:
            return f"{value:.10g}"
        factor = 10 ** max(3 + shown.more, 0)
        scaled = Decimal(repr(value)) / shown.size * factor
        whole = math.floor(scaled) if upper else math.ceil(scaled)
        return format((Decimal(whole) / factor).normalize(), "f")

    def to_own_unit(self, plain: str, unit: str) -> str:
        """Return a typed number (digits and a point) of the shown unit as one of ours, exactly, in digits."""
        shown = self._display_unit(unit)
        return plain if shown is _SAME else format(Decimal(plain) * shown.size, "f")

    def add_inches(self, sentence: str) -> str:
        """Return a sentence with each of its lengths in inches beside it, in brackets; as it is without inches.

        For messages, whose values are quoted in the unit in which they were judged.
        """
        return _LENGTH.sub(self._with_other, sentence) if self.is_inch else sentence

    def _with_other(self, found: re.Match[str]) -> str:
        first, between, second, unit = found.groups()
        numbers = [self.figure(float(each), unit, _decimals(each)) for each in (first, second) if each is not None]
        return f"{found[0]} ({(between or '').join(numbers)} {self.unit(unit)})"

    def _display_unit(self, unit: str) -> _Shown:
        return _INCH.get(unit, _SAME) if self.is_inch else _SAME

    @property
    def names(self) -> Mapping[str, str]:
        """What the placeholders of a unit in the catalogues stand for, such as `{unit_mm}`."""
        return {
            "unit_mm": self.unit("mm"),
            "unit_um": self.unit("um"),
            "unit_mm_s": self.unit("mm/s"),
            "unit_mm_rev": self.unit("mm/rev"),
        }


def _decimals(number: str) -> int:
    return len(number.partition(".")[2])


METRIC = Units()
