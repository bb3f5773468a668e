"""What the page Inspect compares: the last part, and beside it the one before compensation or a recorded one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from console.session.station.state import MeasuredPart, StationState
from console.tui.inspecting.evaluation import VERDICT, Evaluated, Looked, evaluated, supported_upr
from console.tui.inspecting.other_part import OtherPart
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.lobe.lobe_origin import without_lobe
from profiles.roundness import RoundnessResult
from profiles.trace_files.header import header_of

FloatArray = NDArray[np.float64]
_TURN_DEG = np.arange(360.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """One of the two parts, at angles with jaw 1 of the page, um; the lobe that the job states has no `result`."""

    angle_deg: FloatArray
    profile_um: FloatArray
    ront_um: float
    result: RoundnessResult | None
    jaw_1_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """The last part beside another: the same without compensation, or `other` from the record.

    `after` is None where the last part is the one without compensation, and stands alone. `shown` is the last part
    as it is looked at, `supported` are the cut-offs that all traces allow.
    """

    part: MeasuredPart
    before: Side
    after: Side | None
    shown: Evaluated
    looked: Looked = VERDICT
    other: OtherPart | None = None
    supported: tuple[float, ...] = ()

    @property
    def last(self) -> Side:
        """The last part."""
        return self.before if self.after is None else self.after


def compared(state: StationState, looked: Looked = VERDICT, other: OtherPart | None = None) -> Comparison | None:
    """Return the comparison of the last measured part, None when nothing is measured.

    Raises `ProfileError`: a trace cannot be evaluated with the filter that is looked at.
    """
    part = state.measured
    if part is None:
        return None
    plain = _plain(state, part)
    traces = [part.trace, *(() if plain is None else (plain.trace,))]
    traces += [] if other is None else [other.found.turn]
    supported = supported_upr(traces)
    if looked.filter_upr is not None and looked.filter_upr not in supported:
        looked = replace(looked, filter_upr=None)
    upr = looked.upr_for(part.result)
    shown = _seen(part, upr, looked.circle)
    last = _side(shown, part.jaw_1_deg, part.jaw_1_deg if part.phase_known else None)
    after: Side | None = last
    if other is not None:
        before = _other_side(other, part, upr, looked.circle)
    elif not part.strategy.traits.follows_lobe:
        before, after = last, None
    elif plain is not None:
        before = _side(_seen(plain, upr, looked.circle), part.jaw_1_deg, _jaw(plain))
    else:
        before = _stated(part)
    return Comparison(
        part=part, before=before, after=after, shown=shown, looked=looked, other=other, supported=supported
    )


def as_cut(job: Job) -> Job:
    """Return what a plain cut of a job depends on: all but its name, and what its file says of the lobe."""
    return replace(without_lobe(job), name="", lobe_phase_deg=0.0, assumed=(), source="", copied_from=None)


def _plain(state: StationState, part: MeasuredPart) -> MeasuredPart | None:
    """Return the part before compensation, None where none was measured or it is the last one itself."""
    plain = state.uncompensated
    if plain is None or not part.strategy.traits.follows_lobe or as_cut(plain.job) != as_cut(part.job):
        return None
    return plain


def _seen(part: MeasuredPart, upr: float | None, circle: str) -> Evaluated:
    radius_mm = header_of(part.trace.meta)[0].radius_of(part.job)
    return evaluated(part.trace, part.result, upr, circle, radius_mm)


def _jaw(part: MeasuredPart) -> float | None:
    return part.jaw_1_deg if part.phase_known else None


def _side(seen: Evaluated, jaw_1_deg: float, own_jaw_deg: float | None) -> Side:
    """Return a part, turned so that its jaw 1 is at an angle; one that does not know its own is not turned."""
    turn_deg = 0.0 if own_jaw_deg is None else jaw_1_deg - own_jaw_deg
    return Side(
        angle_deg=seen.angle_deg + turn_deg,
        profile_um=seen.profile_um,
        ront_um=seen.ront_um,
        result=seen.result,
        jaw_1_deg=own_jaw_deg,
    )


def _other_side(other: OtherPart, part: MeasuredPart, upr: float | None, circle: str) -> Side:
    found = other.found
    seen = evaluated(found.turn, found.result, upr, circle, found.radius_mm)
    return _side(seen, part.jaw_1_deg, found.jaw_1_deg)


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
