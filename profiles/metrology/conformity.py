"""Whether a measured part conforms to the tolerances of its job, over the length that was measured.

Roundness is judged at the least round section, cylindricity by CYLt (minimum zone, ISO 1101), the mean diameter at
the section that is furthest off. Plain numbers, lengths in um, Z in mm: nothing is evaluated here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


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


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredFigures:
    """The figures of a part: RONt and mean deviation of the section at `z_mm` that was evaluated in full.

    `off_um` is its mean diameter less the nominal one, None without a size. `sections` are all of them, their mean
    deviations from the same radius; with too few for a cylindricity there are none, and no `cylt_um`.
    """

    ront_um: float
    mean_um: float = 0.0
    off_um: float | None = None
    z_mm: float | None = None
    sections: Sequence[SectionForm] = ()
    cylt_um: float | None = None


def judge_figures(measured: MeasuredFigures, limits: Tolerances) -> tuple[JudgedFigure, ...]:
    """Return each figure that has a limit, at its worst section; a diameter only where the size was measured."""
    found = []
    if limits.roundness_um is not None:
        heights = [(measured.ront_um, measured.z_mm), *((each.ront_um, each.z_mm) for each in measured.sections)]
        ront_um, z_mm = max(heights, key=lambda each: each[0])
        found.append(_figure(ToleranceKind.ROUNDNESS, ront_um, limits.roundness_um, z_mm))
    if limits.cylindricity_um is not None:
        found.append(_figure(ToleranceKind.CYLINDRICITY, measured.cylt_um, limits.cylindricity_um, None))
    if limits.diameter_um is not None and (off_um := measured.off_um) is not None:
        offs = [
            (off_um, measured.z_mm),
            *((off_um + 2.0 * (each.mean_um - measured.mean_um), each.z_mm) for each in measured.sections),
        ]
        worst_um, z_mm = max(offs, key=lambda each: abs(each[0]))
        found.append(_figure(ToleranceKind.DIAMETER, worst_um, limits.diameter_um, z_mm))
    return tuple(found)


def _figure(kind: ToleranceKind, value_um: float | None, limit_um: float, z_mm: float | None) -> JudgedFigure:
    return JudgedFigure(kind=kind, value_um=value_um, limit_um=limit_um, z_mm=z_mm)


def passes_all(figures: Iterable[JudgedFigure]) -> bool | None:
    """Return whether a part is good; None if nothing fails, but its cylindricity was not measured."""
    judged = [each.passes for each in figures]
    return False if False in judged else None if None in judged else True


def figure_of(kind: ToleranceKind, figures: Iterable[JudgedFigure]) -> JudgedFigure | None:
    """Return the figure of a kind, None if it is not judged."""
    return next((each for each in figures if each.kind is kind), None)


class WholeForm(Protocol):
    """The form of a part over its length, see `profiles.metrology.cylindricity`."""

    @property
    def sections(self) -> Sequence[SectionForm]:
        """All sections."""

    @property
    def cylt_um(self) -> float:
        """CYLt of the minimum zone."""


def judge_part(
    limits: Tolerances,
    section: tuple[float, float],
    whole: WholeForm | None,
    off_um: float | None,
    z_mm: float | None = None,
) -> tuple[JudgedFigure, ...]:
    """Return the figures of a part that was evaluated just now; values as for `MeasuredFigures`.

    `section` is RONt and the mean deviation of the section that was evaluated in full.
    """
    sections, cylt_um = ((), None) if whole is None else (whole.sections, whole.cylt_um)
    ront_um, mean_um = section
    measured = MeasuredFigures(
        ront_um=ront_um, mean_um=mean_um, off_um=off_um, z_mm=z_mm, sections=sections, cylt_um=cylt_um
    )
    return judge_figures(measured, limits)
