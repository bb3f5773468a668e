"""Whether a calibrated value can be right beside those before it, and else the unit mistake that explains it.

A wrong unit scales a value and its half-width alike, so the confidence of the fit does not show it: only another
value of the same quantity does. This is the one table of such quantities, for every calibration that is kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from profiles.problem import Problem

MOST_STEP = 1.5
"""Largest ratio of a value to one known before that is taken without being typed out (choice).

The smallest unit mistake is 2 (a radius for a diameter, an amplitude for a peak-to-peak value). Grease, wear and
another load cell move a chuck by up to a third. 1.5 lies between both, and statistics have no say: see above.
"""

LARGE_STEP = "calibration.step"
"""Code of the refusal of a larger one."""

ALIKE = 1.15  # two ratios this close may be the same mistake
_TYPED = 0.01  # relative: what is displayed has three to four digits

_TENS = (("x 10", 10.0), ("x 100", 100.0), ("x 1000", 1000.0))
_FORCE = (
    ("kN <> N", 1000.0),
    ("kgf <> N", 9.80665),
    ("lbf <> N", 4.4482216),
    ("F/3 <> F", 3.0),
    ("F/6 <> F", 6.0),
)
_TORQUE = (("N cm <> N m", 100.0), ("kgf m <> N m", 9.80665), ("lbf in <> N m", 8.8507))
_LENGTH = (("mm <> um", 1000.0), ("in <> mm", 25.4), ("mil <> um", 25.4), ("R <> D", 2.0), ("uin <> um", 39.37))


@dataclass(frozen=True, slots=True)
class Quantity:
    """A calibrated quantity: its unit, what is usual where nothing was known before, and its unit mistakes."""

    unit: str
    least: float
    most: float
    mistakes: tuple[tuple[str, float], ...]


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        # Scroll chucks of 80 to 630 mm give 400 to 800 N/(N m) by their makers, dry and worn ones a quarter of it.
        "force_per_torque_n_per_n_m": Quantity("N/(N m)", 100.0, 1500.0, _FORCE + _TORQUE),
        "jaw_stiffness_n_per_um": Quantity("N/um", 15.0, 200.0, _FORCE + _LENGTH),
        "jaw_length_mm": Quantity("mm", 10.0, 160.0, _LENGTH),
        # From what lathes resolve to the largest lobe that a job may state.
        "lobe_error_um_pp": Quantity("um p-p", 0.25, 1000.0, _LENGTH),
        # Bars that are turned: magnesium to cemented carbide.
        "youngs_modulus_gpa": Quantity("GPa", 40.0, 650.0, (("psi <> Pa", 6.895), ("kgf/mm2 <> GPa", 101.97))),
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A value too far from one known before, or, where `known` is False, from what is usual (its nearer end)."""

    key: str
    value: float
    before: float
    known: bool = True

    @property
    def ratio(self) -> float:
        """The value relative to the one before."""
        return self.value / self.before

    @property
    def mistake(self) -> str:
        """The unit mistakes that explain the ratio, empty if none does."""
        if not self.known:
            return ""
        size = _size(self.ratio)
        likely = [(abs(math.log(factor) - size), name) for name, factor in QUANTITIES[self.key].mistakes + _TENS]
        return ", ".join(name for off, name in sorted(likely)[:2] if off <= math.log(ALIKE))

    def is_typed(self, typed: float | None) -> bool:
        """Whether a typed number is the value or its ratio, as both are displayed."""
        ways = (self.value, self.ratio) if self.known else (self.value,)
        return typed is not None and any(abs(typed - way) <= _TYPED * way for way in ways)

    def problem(self, code: str, where: str = "") -> Problem:
        """Return the refusal of the step: the value, the one before with the ratio, and the likely mistake."""
        quantity = QUANTITIES[self.key]
        limit = f"{quantity.least:g} … {quantity.most:g} {quantity.unit}"
        if self.known:
            mistake = f"; {self.mistake}?" if self.mistake else ""
            limit = f"{self.before:.4g} {quantity.unit} (x {self.ratio:.3g}{mistake})"
        return Problem(
            code=code, where=where, key=self.key, value=f"{self.value:.4g} {quantity.unit}", limit=limit
        )


def step_of(key: str, value: float, known: Iterable[float]) -> Step | None:
    """Return the largest step of a value against those known before; without any, against what is usual."""
    before = [each for each in known if each > 0]
    if not before:
        quantity = QUANTITIES[key]
        nearest = min(max(value, quantity.least), quantity.most)
        return None if nearest == value else Step(key=key, value=value, before=nearest, known=False)
    steps = [Step(key=key, value=value, before=each) for each in before]
    worst = max(steps, key=lambda step: _size(step.ratio))
    return None if _size(worst.ratio) <= math.log(MOST_STEP) else worst


def worst_step(steps: Iterable[Step | None]) -> Step | None:
    """Return the largest of some steps; None where there is none."""
    return max((each for each in steps if each is not None), key=lambda step: _size(step.ratio), default=None)


def _size(ratio: float) -> float:
    """Return how far a ratio is from 1, either way; without bound for one that is not positive."""
    return abs(math.log(ratio)) if ratio > 0 else math.inf
