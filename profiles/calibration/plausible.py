"""Whether a calibrated value can be right beside those before it, and else the unit mistake that explains it.

A wrong unit scales a value and its half-width alike, so the confidence of the fit does not show it: only another
value of the same quantity does. This is the one table of such quantities, for every calibration that is kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from types import MappingProxyType
from typing import NamedTuple

from profiles.problem import Problem, ProfileError

LARGE_STEP = "calibration.step"  # code of the refusal
MOST_STEP = 1.5
"""Largest ratio of a value to one known before that is taken without being typed out (choice).

The smallest unit mistake is 2 (a radius for a diameter, an amplitude for a peak-to-peak value); grease, wear and
another load cell move a chuck by up to a third. 1.5 lies between. The scatter has no say, for the reason above.
"""

_ALIKE = math.log(1.15)  # ratios this close may be of the same mistake
_TYPED = 0.01  # relative: what is displayed has three to four digits
_TENS = {"x 10": 10.0, "x 100": 100.0, "x 1000": 1000.0}
_FORCE = {"kN <> N": 1000.0, "kgf <> N": 9.80665, "lbf <> N": 4.4482216, "F/3 <> F": 3.0, "F/6 <> F": 6.0}
_TORQUE = {"N cm <> N m": 100.0, "kgf m <> N m": 9.80665, "lbf in <> N m": 8.8507}
_LENGTH = {"mm <> um": 1000.0, "in <> mm": 25.4, "mil <> um": 25.4, "R <> D": 2.0, "uin <> um": 39.37}
_MODULUS = {"psi <> Pa": 6.895, "kgf/mm2 <> GPa": 101.97}


class CalibratedQuantity(NamedTuple):
    """A calibrated quantity: its unit, what is usual where nothing was known before, and its unit mistakes."""

    unit: str
    least: float
    most: float
    mistakes: Mapping[str, float]


QUANTITIES: Mapping[str, CalibratedQuantity] = MappingProxyType(
    {
        # Scroll chucks of 80 to 630 mm give 400 to 800 N/(N m) by their makers, dry and worn ones a quarter of it.
        "force_per_torque_n_per_n_m": CalibratedQuantity("N/(N m)", 100.0, 1500.0, _FORCE | _TORQUE),
        "jaw_stiffness_n_per_um": CalibratedQuantity("N/um", 15.0, 200.0, _FORCE | _LENGTH),
        "jaw_length_mm": CalibratedQuantity("mm", 10.0, 160.0, _LENGTH),
        "lobe_error_um_pp": CalibratedQuantity("um p-p", 0.25, 1000.0, _LENGTH),  # as `trace_files.plausible`
        "youngs_modulus_gpa": CalibratedQuantity("GPa", 40.0, 650.0, _MODULUS),  # magnesium to cemented carbide
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImplausibleStep:
    """A value too far from one `before`; where nothing was `known`, from the nearer end of what is usual."""

    key: str
    value: float
    before: float
    known: bool = True

    @property
    def ratio(self) -> float:
        """The value relative to the one before."""
        return self.value / self.before

    @property
    def size(self) -> float:
        """How far the ratio is from 1, either way; without bound for one that is not positive."""
        return abs(math.log(self.ratio)) if self.ratio > 0 else math.inf

    def is_typed(self, typed: float | None) -> bool:
        """Whether a typed number is the value or its ratio, as both are displayed."""
        ways = (self.value, self.ratio) if self.known else (self.value,)
        return typed is not None and any(abs(typed - way) <= _TYPED * way for way in ways)

    def problem(self, code: str = LARGE_STEP, where: str = "") -> Problem:
        """Return the refusal: the value, the one before with the ratio, and the unit mistakes that explain it."""
        unit, least, most, mistakes = QUANTITIES[self.key]
        limit = f"{least:g} … {most:g} {unit}"
        if self.known:
            named, tens = _explaining(mistakes, self.size), _explaining(_TENS, self.size)
            likely = ", ".join(named[:2] or tens)
            limit = f"{self.before:.4g} {unit} (x {self.ratio:.3g}{likely and f'; {likely}?'})"
        return Problem(code=code, where=where, key=self.key, value=f"{self.value:.4g} {unit}", limit=limit)


def step_of(key: str, value: float, known: Iterable[float]) -> ImplausibleStep | None:
    """Return the largest step of a value from those known before, without any from what is usual; None: small."""
    steps = [ImplausibleStep(key=key, value=value, before=each) for each in known if each > 0]
    if steps:
        return worst_step(each for each in steps if each.size > math.log(MOST_STEP))
    nearest = min(max(value, QUANTITIES[key].least), QUANTITIES[key].most)
    return None if nearest == value else ImplausibleStep(key=key, value=value, before=nearest, known=False)


def worst_step(steps: Iterable[ImplausibleStep | None]) -> ImplausibleStep | None:
    """Return the largest of some steps; None where there is none."""
    return max((each for each in steps if each is not None), key=attrgetter("size"), default=None)


def refuse_untyped(step: ImplausibleStep | None, typed: float | None, where: str = "") -> None:
    """Refuse (`calibration.step`) a large step of which neither value nor ratio was typed out."""
    if step is not None and not step.is_typed(typed):
        raise ProfileError(step.problem(where=where))


def _explaining(mistakes: Mapping[str, float], size: float) -> list[str]:
    """Return the mistakes that explain a step of this size, the nearest first."""
    off = {name: abs(math.log(factor) - size) for name, factor in mistakes.items()}
    return sorted((name for name in off if off[name] <= _ALIKE), key=off.__getitem__)
