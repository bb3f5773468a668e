"""Whether axes rest, judged from positions that have the noise of their scales.

A scale with 0.3 um of noise differs by more than a count of 0.2 um from poll to poll, at rest. So it is not two
polls that are compared: a line is fitted to the last ones. An axis rests where even the fastest drift that their
scatter allows is slow, and the scatter about the line is small: a loop that hunts has no drift. One whose polls
are within a count of each other rests, too: no less can be seen. Polls count from where rest was first reported,
up to twelve of them: of windows that begin anywhere, one would sooner or later look quiet by chance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.machine import MachineProfile

FEWEST_POLLS, MOST_POLLS = 4, 12
REST_COUNTS_PER_S, REST_UM_PER_S = 5.0, 1.0
"""Drift that counts as rest: the larger of the two. A fine scale has as much noise in more counts."""

SCATTER_S = 1.0  # the scatter about the line may be what that drift is in this time, rms
LEAST_SEEN_COUNTS = 1.0
STUDENT_T = (4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)
"""Quantile 0.975 of Student's t with 2 to 10 degrees of freedom: a line through 4 to 12 polls, or more."""

RestLimits = Mapping[AxisName, float]
"""Drift of each axis that counts as rest, counts/s."""


def rest_limits(machine: MachineProfile) -> RestLimits:
    """Return the limits of a machine."""
    per_um = {
        AxisName.TOOL: machine.tool.counts_per_mm / 1000.0,
        AxisName.CARRIAGE: machine.carriage.counts_per_mm / 1000.0,
    }
    return {axis: max(REST_COUNTS_PER_S, REST_UM_PER_S * per_um.get(axis, 0.0)) for axis in AxisName}


def rest_is_proven(looks: Sequence[Snapshot], limits: RestLimits) -> bool:
    """Whether no driven axis drifts or swings, by the last poll before rest was reported, and all since.

    An axis whose loop was opened may settle during the first ones: all count, or all but the first one or two.
    """
    windows = (looks[head:][-MOST_POLLS:] for head in (0, 1, 2))
    driven = {axis: limits[axis] for axis in looks[-1].driven} if looks else {}
    return any(len(window) >= FEWEST_POLLS and all_rest(window, driven) for window in windows)


def all_rest(looks: Sequence[Snapshot], limits: RestLimits) -> bool:
    """Whether all of these polls, at least 4, leave each axis of the limits neither drift nor swing."""
    times_s = [look.at_s for look in looks]
    return all(_rests(times_s, [look.axis(axis).position for look in looks], limits[axis]) for axis in limits)


def _rests(times_s: Sequence[float], positions: Sequence[float], limit: float) -> bool:
    if times_s[0] < times_s[-1] and max(positions) - min(positions) <= LEAST_SEEN_COUNTS:
        return True
    drift, scatter = drift_and_scatter(times_s, positions)
    return drift <= limit and scatter <= SCATTER_S * limit


def drift_and_scatter(times_s: Sequence[float], positions: Sequence[float]) -> tuple[float, float]:
    """Return the greatest speed of an axis that its positions allow, counts/s, and their scatter, counts rms.

    The speed is the upper bound of the 95 % interval of a fitted line's slope, the scatter that about the line.
    Takes at least 4 positions, counts, and their times. Source: linear regression, interval of the slope.
    """
    count = len(times_s)
    mean_s, mean = sum(times_s) / count, sum(positions) / count
    spread_s2 = sum((at_s - mean_s) ** 2 for at_s in times_s)
    if spread_s2 == 0.0:
        return math.inf, math.inf
    off = [(at_s - mean_s, place - mean) for at_s, place in zip(times_s, positions, strict=True)]
    slope = sum(at_s * place for at_s, place in off) / spread_s2
    scatter = math.sqrt(sum((place - slope * at_s) ** 2 for at_s, place in off) / (count - 2))
    quantile = STUDENT_T[min(count - FEWEST_POLLS, len(STUDENT_T) - 1)]
    return abs(slope) + quantile * scatter / math.sqrt(spread_s2), scatter
