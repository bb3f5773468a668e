"""Whether a measured part conforms to the tolerances of its job, over the length that was measured.

Roundness is judged at the least round section, cylindricity by CYLt (minimum zone, ISO 1101), the mean diameter at
the section that is furthest off. Plain numbers, lengths in um, Z in mm: nothing is evaluated here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum


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
    and where its height is not known.
    """

    kind: ToleranceKind
    value_um: float | None
    limit_um: float
    z_mm: float | None = None

    @property
    def passes(self) -> bool | None:
        """Whether it is within its limit; None if it was not measured."""
        return None if self.value_um is None else abs(self.value_um) <= self.limit_um


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
) -> tuple[JudgedFigure, ...]:
    """Return each figure of a part that has a limit, at its worst section.

    RONt and mean deviation are those of the section at `z_mm` that was evaluated in full, `off_um` its mean
    diameter less the nominal one, None without a size: then no diameter is judged. `sections` are all of them,
    their mean deviations from the same radius; with too few for a cylindricity there are none, and no `cylt_um`.

    Points that are no sections have no RONt (None): they show no roundness. `off_um` is that of their cylinder,
    whose radius rises by `taper_um` over the length: the diameter is judged at the end that is further off.
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
    return tuple(found)


def passes_all(figures: Iterable[JudgedFigure]) -> bool | None:
    """Return whether a part is good; None if nothing fails, but one was not measured."""
    judged = [each.passes for each in figures]
    return False if False in judged else None if None in judged else True


def figure_of(kind: ToleranceKind, figures: Iterable[JudgedFigure]) -> JudgedFigure | None:
    """Return the figure of a kind, None if it is not judged."""
    return next((each for each in figures if each.kind is kind), None)
