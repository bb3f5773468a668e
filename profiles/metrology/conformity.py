"""Whether a measured part conforms to the tolerances of its job, over the length that was measured.

Roundness is judged at the least round section, cylindricity by CYLt (minimum zone, ISO 1101), the mean diameter at
the section that is furthest off. Plain numbers, lengths in um, Z in mm: nothing is evaluated here.

With a gauge a figure passes or fails only if that is proven by ISO 14253-1. Edition 2017: with a probability of
95 %, the figure being normal about its value with the standard uncertainty U / 2 (JCGM 106, 7.2 and 7.3); of the
one limit of RONt and CYLt that is a guard of 1.65 u, of the two of a diameter up to 1.96 u. The editions before
(2013): a guard of U, k = 2. Between, neither is proven.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

PROVEN = 0.95  # default probability of ISO 14253-1:2017
COVERAGE_FACTOR = 2.0  # k: U = k u
ONE_SIDED = 1.645  # standard deviations below which 95 % of a normal distribution lie


class DecisionRule(StrEnum):
    """How a figure with an uncertainty is judged; SIMPLE: by its value alone."""

    ISO_2017 = "iso-14253-1:2017"
    ISO_2013 = "iso-14253-1:2013"
    SIMPLE = "simple"


class ToleranceKind(StrEnum):
    """What a tolerance is of."""

    ROUNDNESS = "roundness"
    CYLINDRICITY = "cylindricity"
    DIAMETER = "diameter"


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionForm:
    """One section: its height, its roundness (LSCI) and its mean deviation from the nominal radius."""

    z_mm: float
    ront_um: float
    mean_um: float

    def fields(self) -> dict[str, float]:
        """Return it as records and results in JSON have it."""
        return {"z_mm": self.z_mm, "RONt_um": self.ront_um, "mean_um": self.mean_um}


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """The limits of a job; None is not judged. The diameter may be off either way."""

    roundness_um: float | None = None
    cylindricity_um: float | None = None
    diameter_um: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedFigure:
    """A figure against its limit: RONt, CYLt, or how far a mean diameter is off, positive if it is too large.

    `value_um` is None where it was not measured. `z_mm` is the section that is judged; None of CYLt,
    and where its height is not known. `u_um` is its expanded uncertainty (k = 2), None if it is not known, and
    `rule` how it is judged with that, None without a gauge. `expired` is the last day of a gauge if that was over.
    """

    kind: ToleranceKind
    value_um: float | None
    limit_um: float
    z_mm: float | None = None
    u_um: float | None = None
    rule: DecisionRule | None = None
    expired: str = ""

    @property
    def guarded(self) -> bool:
        """Whether it passes or fails only beyond a guard."""
        return self.rule not in (None, DecisionRule.SIMPLE)

    @property
    def guard_um(self) -> float | None:
        """By how much the value has to be off its limit; 0 of a simple rule, None without a gauge, or without U.

        Of a diameter whose uncertainty is no small part of its tolerance, by more: see `conforming`.
        """
        if self.rule is DecisionRule.SIMPLE:
            return 0.0
        if self.u_um is None or self.rule is None:
            return None
        return self.u_um if self.rule is DecisionRule.ISO_2013 else ONE_SIDED * self.u_um / COVERAGE_FACTOR

    @property
    def conforming(self) -> float | None:
        """Probability that the true figure is within its limit; None if that is not known."""
        if self.value_um is None or self.u_um is None:
            return None
        u_um = self.u_um / COVERAGE_FACTOR
        below = _share_below(self.limit_um - self.value_um, u_um)
        if self.kind is not ToleranceKind.DIAMETER:
            return below
        return below - _share_below(-self.limit_um - self.value_um, u_um)

    @property
    def is_open(self) -> bool:
        """Whether it was measured, and neither way is proven."""
        return self.value_um is not None and self.passes is None

    @property
    def passes(self) -> bool | None:
        """Whether it is within its limit; None if it was not measured, or neither way is proven."""
        if self.value_um is None:
            return None
        within_um = self.limit_um - abs(self.value_um)
        if not self.guarded:
            return within_um >= 0.0
        if self.u_um is None or (conforming := self.conforming) is None:
            return None
        if self.rule is DecisionRule.ISO_2013:
            proven, refuted = within_um >= self.u_um, within_um < -self.u_um
        else:
            proven, refuted = conforming >= PROVEN, conforming <= 1.0 - PROVEN
        return True if proven else False if refuted else None


def _share_below(distance_um: float, u_um: float) -> float:
    """Return the part of a normal distribution below a limit that is so far above its mean."""
    if u_um <= 0.0:
        return 1.0 if distance_um >= 0.0 else 0.0
    return 0.5 * math.erfc(-distance_um / (u_um * math.sqrt(2.0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureUncertainty:
    """Expanded uncertainties (k = 2) of the figures of a part, um; None is not known. `rule` judges with them.

    `expired` is the last day on which the gauge was valid, if that was over; "": it was valid.
    """

    rule: DecisionRule
    roundness_um: float | None = None
    cylindricity_um: float | None = None
    diameter_um: float | None = None
    expired: str = ""

    def of(self, kind: ToleranceKind) -> float | None:
        """Return that of a figure."""
        known = {ToleranceKind.ROUNDNESS: self.roundness_um, ToleranceKind.CYLINDRICITY: self.cylindricity_um}
        return known.get(kind, self.diameter_um)


def judge_part(
    limits: Tolerances,
    *,
    ront_um: float | None,
    mean_um: float,
    off_um: float | None,
    z_mm: float | None = None,
    sections: Sequence[SectionForm] = (),
    taper_um: float = 0.0,
    cylt_um: float | None = None,
    uncertainty: FigureUncertainty | None = None,
) -> tuple[JudgedFigure, ...]:
    """Return each figure of a part that has a limit, at its worst section.

    RONt and mean deviation are those of the section at `z_mm` that was evaluated in full, `off_um` its mean
    diameter less the nominal one, None without a size: then no diameter is judged. `sections` are all of them,
    their mean deviations from the same radius; with too few for a cylindricity there are none, and no `cylt_um`.

    Points that are no sections have no RONt (None): they show no roundness. `off_um` is that of their cylinder,
    whose radius rises by `taper_um` over the length: the diameter is judged at the end that is further off.
    `uncertainty` is None without a gauge.
    """
    found, kind = list[JudgedFigure](), ToleranceKind
    if (limit_um := limits.roundness_um) is not None:
        worst_um, at_mm = ront_um, z_mm
        for each in sections:
            if worst_um is not None and each.ront_um > worst_um:
                worst_um, at_mm = each.ront_um, each.z_mm
        found.append(JudgedFigure(kind=kind.ROUNDNESS, value_um=worst_um, limit_um=limit_um, z_mm=at_mm))
    if (limit_um := limits.cylindricity_um) is not None:
        found.append(JudgedFigure(kind=kind.CYLINDRICITY, value_um=cylt_um, limit_um=limit_um))
    if (limit_um := limits.diameter_um) is not None and off_um is not None:
        if ront_um is None:
            off_um += math.copysign(taper_um, off_um)
        offs = [(off_um, z_mm), *((off_um + 2.0 * (each.mean_um - mean_um), each.z_mm) for each in sections)]
        worst_um, at_mm = max(offs, key=lambda each: abs(each[0]))
        found.append(JudgedFigure(kind=kind.DIAMETER, value_um=worst_um, limit_um=limit_um, z_mm=at_mm))
    if uncertainty is None:
        return tuple(found)
    rule, expired = uncertainty.rule, uncertainty.expired
    return tuple(replace(each, u_um=uncertainty.of(each.kind), rule=rule, expired=expired) for each in found)


def passes_all(figures: Iterable[JudgedFigure]) -> bool | None:
    """Return whether a part is good; None if nothing fails, but a figure was not measured or is not proven."""
    judged = [each.passes for each in figures]
    return False if False in judged else None if None in judged else True


def figure_of(kind: ToleranceKind, figures: Iterable[JudgedFigure]) -> JudgedFigure | None:
    """Return the figure of a kind, None if it is not judged."""
    return next((each for each in figures if each.kind is kind), None)
