"""Whether axes rest, judged from positions that have the noise of their scales.

A scale with 0.3 um of noise differs by more than a count of 0.2 um from poll to poll, at rest. So it is not two
polls that are compared: a line is fitted to the last ones, and rest is proven where even the fastest drift that
their scatter allows is slow. A quiet scale takes four polls, a noisy one some more; what moves never gets there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from drivers.lathe.snapshot import AxisName, Snapshot

REST_COUNTS_PER_S = 5.0
FEWEST_POLLS, MOST_POLLS = 4, 12
STUDENT_T = (4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)
"""Quantile 0.975 of Student's t with 2 to 10 degrees of freedom: a line through 4 to 12 polls, or more."""


def rest_is_proven(looks: Sequence[Snapshot]) -> bool:
    """Whether no driven axis drifts, by as many of the last polls as are needed, 4 to 12 of them."""
    most = min(len(looks), MOST_POLLS)
    return any(none_drifts(looks[-polls:], looks[-1].driven) for polls in range(FEWEST_POLLS, most + 1))


def none_drifts(looks: Sequence[Snapshot], axes: Iterable[AxisName]) -> bool:
    """Whether all of these polls, at least 4, leave no drift of an axis above 5 counts/s."""
    times_s = [look.at_s for look in looks]
    positions = ([look.axis(axis).position for look in looks] for axis in axes)
    return all(drift_bound_counts_per_s(times_s, each) <= REST_COUNTS_PER_S for each in positions)


def drift_bound_counts_per_s(times_s: Sequence[float], positions: Sequence[float]) -> float:
    """Return the upper bound of the speed of an axis, counts/s: of the 95 % interval of a fitted line's slope.

    Takes at least 4 positions, counts, and their times. Source: linear regression, interval of the slope.
    """
    count = len(times_s)
    mean_s, mean = sum(times_s) / count, sum(positions) / count
    spread_s2 = sum((at_s - mean_s) ** 2 for at_s in times_s)
    if spread_s2 == 0.0:
        return math.inf
    off = [(at_s - mean_s, place - mean) for at_s, place in zip(times_s, positions, strict=True)]
    slope = sum(at_s * place for at_s, place in off) / spread_s2
    residual = sum((place - slope * at_s) ** 2 for at_s, place in off)
    quantile = STUDENT_T[min(count - FEWEST_POLLS, len(STUDENT_T) - 1)]
    return abs(slope) + quantile * math.sqrt(residual / (count - 2) / spread_s2)
