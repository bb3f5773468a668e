"""Comparison on the page Inspect: the last part with the one before compensation or a recorded one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from console.session.learning.evaluated_part import EvaluatedPart
from console.session.station.state import MeasuredPart, StationState
from console.tui.inspecting.evaluation import VERDICT, DisplayFilter, Side, list_supported_upr, side_of
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.lobe.lobe_origin import without_lobe
from profiles.roundness import RoundnessResult
from profiles.trace_files.header import header_of

_TURN_DEG = np.arange(360.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """The last part beside another: the same without compensation, or `other` from the record.

    `after` is None where the last part is the one without compensation, and stands alone. `supported` are the
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
) -> Comparison | None:
    """Return the comparison of the last measured part, None when nothing is measured.

    Raises `ProfileError`: a trace cannot be evaluated with the filter that is looked at.
    """
    part = state.measured
    if part is None:
        return None
    plain = _plain(state, part)
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
        before = _stated(part)
    return Comparison(part=part, before=before, after=after, looked=looked, other=other, supported=supported)


def strip_lobe(job: Job) -> Job:
    """Return a job without its name and its lobe: the rest determines a plain cut."""
    return replace(without_lobe(job), name="", lobe_phase_deg=0.0, assumed=(), source="", copied_from=None)


def _plain(state: StationState, part: MeasuredPart) -> MeasuredPart | None:
    """Return the part before compensation, None where none was measured or it is the last one itself."""
    plain = state.uncompensated
    if plain is None or not part.strategy.traits.follows_lobe or strip_lobe(plain.job) != strip_lobe(part.job):
        return None
    return plain


def _jaw(part: MeasuredPart) -> float | None:
    return part.jaw_1_deg if part.phase_known else None


def _stated(part: MeasuredPart) -> Side:
    past_deg = part.job.lobe_past_jaw_deg or 0.0
    lobe = free_state_lobe(replace(part.job, lobe_phase_deg=part.jaw_1_deg + past_deg))
    return Side(
        angle_deg=_TURN_DEG,
        profile_um=lobe.at_um(_TURN_DEG),
        ront_um=part.job.lobe_error_um_pp,
        result=None,
        jaw_1_deg=part.jaw_1_deg,
    )
