"""A measured trace by the circle and the filter that the operator looks at; its verdict stays with its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from profiles.arrays import Floats
from profiles.metrology.circles import CIRCLES, LEAST_SQUARES, MAXIMUM_INSCRIBED, MINIMUM_CIRCUMSCRIBED
from profiles.metrology.points import POINTS_PER_UNDULATION, largest_gap_deg
from profiles.roundness import RoundnessResult, evaluate, profile_of
from profiles.traces import Trace

FILTERS_UPR = (15.0, 50.0, 150.0, 500.0)
"""Cut-offs of ISO 12181-2 to look at a part with, undulations per revolution."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Looked:
    """What a part is looked at with: one of `CIRCLES`, and a cut-off; None is that of its verdict."""

    circle: str = LEAST_SQUARES
    filter_upr: float | None = None

    @property
    def is_verdict(self) -> bool:
        """Whether these are the circle and the filter by which parts are judged."""
        return self == VERDICT

    def upr_for(self, judged: RoundnessResult) -> float | None:
        """Return the cut-off for a part with this verdict; None is no filter."""
        return judged.filter_upr if self.filter_upr is None else self.filter_upr


VERDICT = Looked()
"""How parts are judged."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluated:
    """A part as it is looked at: its figures, and M angles, deg, with the deviations from its circle, um."""

    result: RoundnessResult
    angle_deg: Floats
    profile_um: Floats
    circle: str = LEAST_SQUARES

    @property
    def ront_um(self) -> float:
        """RONt about the circle."""
        return self.result.circle(self.circle).ront_um


def evaluated(
    trace: Trace, judged: RoundnessResult, upr: float | None, circle: str, radius_mm: float | None = None
) -> Evaluated:
    """Return a trace that was `judged` so, with another filter and about another circle; `radius_mm` as then.

    Raises `ProfileError`: as `profiles.roundness.evaluate`.
    """
    # One that was judged about its own centre is taken there with every filter, and drawn so.
    radius_mm = radius_mm if judged.recentred else None
    seen = judged
    if upr != judged.filter_upr:
        seen = evaluate(trace.angle_deg, trace.deviation_um, upr, state=judged.state, radius_mm=radius_mm)
    angle_deg, profile_um = profile_of(trace.angle_deg, trace.deviation_um, upr, kind=circle, radius_mm=radius_mm)
    return Evaluated(result=seen, angle_deg=angle_deg, profile_um=profile_um, circle=circle)


def supported_upr(traces: Sequence[Trace]) -> tuple[float, ...]:
    """Return the cut-offs for which all traces have enough points, by their largest step."""
    points = min((round(360.0 / largest_gap_deg(trace.angle_deg)) for trace in traces), default=0)
    return tuple(upr for upr in FILTERS_UPR if points >= POINTS_PER_UNDULATION * upr)


def with_next_filter(looked: Looked, judged_upr: float | None, supported: Sequence[float]) -> Looked:
    """Return the next wider filter, the narrowest after the widest; `judged_upr` is that of the verdict."""
    choices = sorted({*supported, *(() if judged_upr is None else (judged_upr,))})
    if not choices:
        return Looked(circle=looked.circle)
    shown = judged_upr if looked.filter_upr is None else looked.filter_upr
    wider = [upr for upr in choices if shown is not None and upr > shown]
    following = wider[0] if wider else choices[0]
    return Looked(circle=looked.circle, filter_upr=None if following == judged_upr else following)


def with_next_circle(looked: Looked) -> Looked:
    """Return the next of the four circles: LSC, MZC, MCC, MIC."""
    following = CIRCLES[(CIRCLES.index(looked.circle) + 1) % len(CIRCLES)]
    return Looked(circle=following, filter_upr=looked.filter_upr)


def tolerance_rings_um(seen: Evaluated, tolerance_um: float) -> tuple[float, float]:
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
