"""Comparison on the page Inspect: the last part with the one before compensation or a recorded one.

Reference circle and filter are those chosen for display; a verdict keeps its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from console.session.learning.evaluated_part import EvaluatedPart
from console.session.station.state import MeasuredPart, StationState
from profiles.arrays import Floats
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.lobe.lobe_origin import without_lobe
from profiles.metrology.circles import CIRCLES, LEAST_SQUARES, MAXIMUM_INSCRIBED, MINIMUM_CIRCUMSCRIBED
from profiles.metrology.points import POINTS_PER_UNDULATION, largest_gap_deg
from profiles.roundness import RoundnessResult, evaluate, profile_of
from profiles.trace_files.header import header_of
from profiles.traces import Trace

FILTERS_UPR = (15.0, 50.0, 150.0, 500.0)
"""Cut-offs of ISO 12181-2 to look at a part with, undulations per revolution."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DisplayFilter:
    """Circle (one of `CIRCLES`) and filter cut-off for display; None is the cut-off of the verdict."""

    circle: str = LEAST_SQUARES
    filter_upr: float | None = None

    @property
    def is_verdict(self) -> bool:
        """Whether these are the circle and filter of the verdict."""
        return self == VERDICT

    def upr_for(self, judged: RoundnessResult) -> float | None:
        """Return the cut-off for a part with this verdict; None is no filter."""
        return judged.filter_upr if self.filter_upr is None else self.filter_upr


VERDICT = DisplayFilter()
"""How parts are judged."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """A trace of the comparison as displayed: M angles, deg, with deviations from the reference circle, um.

    `ront_um` is that about the circle. The lobe that the job states has no `result`; `jaw_1_deg` is None if the
    trace is not tied to jaw 1.
    """

    angle_deg: Floats
    profile_um: Floats
    ront_um: float
    result: RoundnessResult | None
    jaw_1_deg: float | None
    circle: str = LEAST_SQUARES


def side_of(
    trace: Trace,
    judged: RoundnessResult,
    upr: float | None,
    circle: str,
    radius_mm: float | None,
    jaw_1_deg: float | None,
    turn_deg: float,
) -> Side:
    """Return a trace that was `judged` so, with another filter and about another circle; `radius_mm` as then.

    It is turned by `turn_deg`; its jaw 1 was found at `jaw_1_deg`.

    Raises `ProfileError`: as `profiles.roundness.evaluate`.
    """
    # One that was judged about its own centre is taken there with every filter, and drawn so.
    radius_mm = radius_mm if judged.recentred else None
    seen = judged
    if upr != judged.filter_upr:
        seen = evaluate(trace.angle_deg, trace.deviation_um, upr, state=judged.state, radius_mm=radius_mm)
    angle_deg, profile_um = profile_of(trace.angle_deg, trace.deviation_um, upr, kind=circle, radius_mm=radius_mm)
    return Side(
        angle_deg=angle_deg + turn_deg,
        profile_um=profile_um,
        ront_um=seen.circle(circle).ront_um,
        result=seen,
        jaw_1_deg=jaw_1_deg,
        circle=circle,
    )


def list_supported_upr(traces: Sequence[Trace]) -> tuple[float, ...]:
    """Return the cut-offs for which all traces have enough points, by their largest step."""
    points = min((round(360.0 / largest_gap_deg(trace.angle_deg)) for trace in traces), default=0)
    return tuple(upr for upr in FILTERS_UPR if points >= POINTS_PER_UNDULATION * upr)


def next_filter(looked: DisplayFilter, judged_upr: float | None, supported: Sequence[float]) -> DisplayFilter:
    """Return the next wider filter, the narrowest after the widest; `judged_upr` is that of the verdict."""
    choices = sorted({*supported, *(() if judged_upr is None else (judged_upr,))})
    if not choices:
        return DisplayFilter(circle=looked.circle)
    shown = judged_upr if looked.filter_upr is None else looked.filter_upr
    wider = [upr for upr in choices if shown is not None and upr > shown]
    following = wider[0] if wider else choices[0]
    return DisplayFilter(circle=looked.circle, filter_upr=None if following == judged_upr else following)


def next_circle(looked: DisplayFilter) -> DisplayFilter:
    """Return the next of the four circles: LSC, MZC, MCC, MIC."""
    following = CIRCLES[(CIRCLES.index(looked.circle) + 1) % len(CIRCLES)]
    return DisplayFilter(circle=following, filter_upr=looked.filter_upr)


def tolerance_rings_um(seen: Side, tolerance_um: float) -> tuple[float, float]:
    """Return the two circles, um from the reference circle, between which a trace within its tolerance lies.

    They are `tolerance_um` apart: from the inscribed circle outwards, from the circumscribed one inwards, and
    about the middle of the trace for the others. It is between them where its RONt is within the tolerance.
    """
    if seen.circle == MAXIMUM_INSCRIBED:
        return 0.0, tolerance_um
    if seen.circle == MINIMUM_CIRCUMSCRIBED:
        return -tolerance_um, 0.0
    middle_um = 0.5 * (float(np.max(seen.profile_um)) + float(np.min(seen.profile_um)))
    return middle_um - 0.5 * tolerance_um, middle_um + 0.5 * tolerance_um


_TURN_DEG = np.arange(360.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartComparison:
    """The last part beside another: the same without compensation, or `other` from the record.

    `after` is None if the last part is the one without compensation, which stands alone. `supported` are the
    cut-offs that all traces allow.
    """

    part: MeasuredPart
    before: Side
    after: Side | None
    looked: DisplayFilter = VERDICT
    other: EvaluatedPart | None = None
    supported: tuple[float, ...] = ()

    @property
    def last(self) -> Side:
        """The last part."""
        return self.before if self.after is None else self.after

    @property
    def result(self) -> RoundnessResult:
        """The result of the last part as displayed."""
        assert self.last.result is not None
        return self.last.result


def compare_parts(
    state: StationState, looked: DisplayFilter = VERDICT, other: EvaluatedPart | None = None
) -> PartComparison | None:
    """Return the comparison of the last measured part, None before any measurement.

    Raises `ProfileError`: a trace cannot be evaluated with the displayed filter.
    """
    part = state.measured
    if part is None:
        return None
    plain = _uncompensated_part(state, part)
    traces = [part.trace, *(() if plain is None else (plain.trace,))]
    traces += [] if other is None else [other.turn]
    supported = list_supported_upr(traces)
    if looked.filter_upr is not None and looked.filter_upr not in supported:
        looked = replace(looked, filter_upr=None)
    upr = looked.upr_for(part.result)

    def side(each: MeasuredPart) -> Side:
        radius_mm = header_of(each.trace.meta)[0].radius_of(each.job)
        turn_deg = part.jaw_1_deg - each.jaw_1_deg if each.phase_known else 0.0
        return side_of(each.trace, each.result, upr, looked.circle, radius_mm, _jaw(each), turn_deg)

    last = side(part)
    after: Side | None = last
    if other is not None:
        turn_deg = 0.0 if other.jaw_1_deg is None else part.jaw_1_deg - other.jaw_1_deg
        before = side_of(other.turn, other.result, upr, looked.circle, other.radius_mm, other.jaw_1_deg, turn_deg)
    elif not part.strategy.traits.follows_lobe:
        before, after = last, None
    elif plain is not None:
        before = side(plain)
    else:
        before = _job_lobe_side(part)
    return PartComparison(part=part, before=before, after=after, looked=looked, other=other, supported=supported)


def strip_lobe(job: Job) -> Job:
    """Return a job without its name and its lobe: the rest determines a plain cut."""
    return replace(without_lobe(job), name="", lobe_phase_deg=0.0, assumed=(), source="", copied_from=None)


def _uncompensated_part(state: StationState, part: MeasuredPart) -> MeasuredPart | None:
    """Return the part before compensation, None without one, or if it is the last one itself."""
    plain = state.uncompensated
    if plain is None or not part.strategy.traits.follows_lobe or strip_lobe(plain.job) != strip_lobe(part.job):
        return None
    return plain


def _jaw(part: MeasuredPart) -> float | None:
    return part.jaw_1_deg if part.phase_known else None


def _job_lobe_side(part: MeasuredPart) -> Side:
    past_deg = part.job.lobe_past_jaw_deg or 0.0
    lobe = free_state_lobe(replace(part.job, lobe_phase_deg=part.jaw_1_deg + past_deg))
    return Side(
        angle_deg=_TURN_DEG,
        profile_um=lobe.at_um(_TURN_DEG),
        ront_um=part.job.lobe_error_um_pp,
        result=None,
        jaw_1_deg=part.jaw_1_deg,
    )
