"""Run chart of a job: its measured parts in the order of manufacture, with limits and capability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from pathlib import Path

from console.session.data.measured_part import UNDATED, RecordedPart
from console.session.data.run_reader import measured_parts
from console.session.data.run_rows import RunRow
from profiles.metrology.process_statistics import (
    LEAST_PARTS,
    Capability,
    RunChart,
    Trend,
    capability_below,
    capability_within,
    run_chart,
    trend,
)

MOST_PARTS = 500
MOST_BEYOND = 0.01
"""Fraction of the parts beyond the limits above which a process is not stable; by chance it is 0.003."""


class ChartedQuantity(StrEnum):
    """The charted figure of each part."""

    RONT = "ront"
    DIAMETER = "diameter"


class NoClaim(StrEnum):
    """Why no capability is claimed."""

    NO_TOLERANCE = "no_tolerance"
    FEW = "few"
    SAME = "same"
    UNSTABLE = "unstable"
    LATER = "later"  # computed at standstill


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JobChart:
    """One figure of some parts, um (a diameter as its deviation from nominal), with its tolerance.

    `parts` are the full parts of a job cut with one strategy, oldest first; the record has `others`. `numbers` are
    the places of the values among the parts, from 1. Those from `begins` on were made alike: same compensation,
    same tolerance. All statistics are theirs. `lobe` is the trend of the lobe, um p-p for each part.
    """

    parts: tuple[RecordedPart, ...]
    figure: ChartedQuantity
    job: str = ""
    strategy: str = ""
    others: int = 0
    numbers: tuple[int, ...] = ()
    values_um: tuple[float, ...] = ()
    first: datetime = UNDATED
    last: datetime = UNDATED
    begins: int = 0
    lower_um: float | None = None
    upper_um: float | None = None
    limits: RunChart | None = None
    capability: Capability | None = None
    no_claim: NoClaim | None = None
    lobe: Trend | None = None

    @property
    def alike_count(self) -> int:
        """Number of parts made alike, up to the newest."""
        return len(self.values_um) - self.begins

    @property
    def places_beyond_limits(self) -> tuple[int, ...]:
        """Places, among the values, of those beyond the limits."""
        return () if self.limits is None else tuple(self.begins + place for place in self.limits.beyond)


def list_like_parts(data: Path, row: RunRow) -> tuple[tuple[RecordedPart, ...], int]:
    """Return the full parts of a run's job, on its machine, cut as it was, and how many others the record has.

    Raises SessionError: as `measured_parts`.
    """
    found = measured_parts(data, row.job, row.machine, row.simulated, MOST_PARTS)
    alike = tuple(each for each in found if each.is_full and each.strategy == row.strategy)
    return alike, len(found) - len(alike)


def job_chart(parts: tuple[RecordedPart, ...], figure: ChartedQuantity, *, judge: bool = True) -> JobChart:
    """Return the chart of one figure; without `judge`, no statistics that load scipy."""
    known = [(place, point) for place, point in enumerate(parts, 1) if _value_um(point, figure) is not None]
    values = tuple(value for _, point in known if (value := _value_um(point, figure)) is not None)
    points = [point for _, point in known]
    begins = _begins(points)
    lower_um, upper_um = _tolerance_um(points, figure)
    alike = values[begins:]
    limits = run_chart(alike) if alike else None
    capability, no_claim = _claim(alike, lower_um, upper_um, limits, judge=judge)
    lobes = [point.lobe_um_pp for point in points[begins:] if point.lobe_um_pp is not None]
    return JobChart(
        parts=parts,
        figure=figure,
        numbers=tuple(place for place, _ in known),
        values_um=values,
        first=points[0].at if points else UNDATED,
        last=points[-1].at if points else UNDATED,
        begins=begins,
        lower_um=lower_um,
        upper_um=upper_um,
        limits=limits,
        capability=capability,
        no_claim=no_claim,
        lobe=trend(lobes) if judge and lobes else None,
    )


def _value_um(point: RecordedPart, figure: ChartedQuantity) -> float | None:
    return point.worst[0] if figure is ChartedQuantity.RONT else point.off_nominal_um


def _begins(points: Sequence[RecordedPart]) -> int:
    """Return the index of the first of the newest parts that were made alike."""
    made = [
        (
            each.compensation,
            each.inverted,
            each.tolerance_um,
            each.nominal_diameter_mm,
            each.diameter_tolerance_um,
        )
        for each in points
    ]
    others = (place for place in range(len(made), 0, -1) if made[place - 1] != made[-1])
    return next(others, 0)


def _tolerance_um(points: Sequence[RecordedPart], figure: ChartedQuantity) -> tuple[float | None, float | None]:
    if not points:
        return None, None
    if figure is ChartedQuantity.RONT:
        return None, points[-1].tolerance_um
    off_um = points[-1].diameter_tolerance_um
    return (None, None) if off_um is None else (-off_um, off_um)


def _claim(
    values: Sequence[float],
    lower_um: float | None,
    upper_um: float | None,
    limits: RunChart | None,
    *,
    judge: bool,
) -> tuple[Capability | None, NoClaim | None]:
    """Return the capability, or why none is claimed: an index of an unstable process predicts nothing."""
    if upper_um is None:
        return None, NoClaim.NO_TOLERANCE
    if len(values) < LEAST_PARTS:
        return None, NoClaim.FEW
    if limits is not None and len(limits.beyond) > max(MOST_BEYOND * len(values), 1.0):
        return None, NoClaim.UNSTABLE
    if not judge:
        return None, NoClaim.LATER
    index = (
        capability_below(values, upper_um) if lower_um is None else capability_within(values, lower_um, upper_um)
    )
    return index, NoClaim.SAME if index is None else None
