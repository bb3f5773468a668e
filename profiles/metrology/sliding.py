"""Choose among equally good positions of a circle the one that the data alone determine.

Two exactly opposite points, such as the maxima of an oval, fix a circumscribed or inscribed circle in one
direction only: within bounds every position is equally good, and a programme would end at an arbitrary one. ISO
12181-1 leaves it open. Here it is the position with the least RONt and, where that is not unique either, the
one nearest to the centre of least squares: both turn with the part, and for an oval they are its middle. A
minimum zone that may slide has one RONt; its centre is the nearest one, too. A handful of points is not a
profile: nothing is known between them. There a circumscribed or inscribed circle slides until a third point
stops it, the shorter way from the centre of least squares, as in published examples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats, floats

# Rate, per step of the centre, below which a point keeps its distance: the contacts of the circle.
_KEEPS_DISTANCE = 1e-9
HANDFUL = 32
"""Fewer points than this are not a profile."""

_LEVEL = 1e-13
"""Difference of two deviations, as a fraction of the peak to peak, that is rounding."""


def settled(columns: Floats, gains: Floats, prices: Floats, held: NDArray[np.intp], *, one_sided: bool) -> Floats:
    """Return the prices of the position chosen among all optima; the given ones where there is no other.

    `columns` (m, n), `gains` (n,) and `prices` (m,) are those of `profiles.metrology.exchange`: columns^T
    prices >= gains, and the last two prices are the centre from that of least squares. `held` are the contacts
    with a weight. `one_sided` is a circumscribed or inscribed circle, whose RONt depends on the position.
    Several heights at one angle may let a zone slide in two directions; it then stays where it is.
    """
    free = len(prices) - held.size
    if free != 1:
        return prices
    along = np.linalg.svd(columns[:, held].T)[2][-1]
    slack, rates = np.maximum(columns.T @ prices - gains, 0.0), columns.T @ along
    low, high = _allowed(slack, rates, -np.inf, np.inf)
    nearest = -float(prices[-2:] @ along[-2:]) / float(along[-2:] @ along[-2:])
    if one_sided:
        across, start = columns[1:].T @ along[1:], columns[1:].T @ prices[1:]
        least = _lowest(start - gains, across, low, high)
        low, high = least if gains.size >= HANDFUL else _held_by_three(low, high, nearest, least)
    return floats(prices + min(max(nearest, low), high) * along)


def _held_by_three(low: float, high: float, nearest: float, least: tuple[float, float]) -> tuple[float, float]:
    """Return the end nearer to a position; of two equally near, the one nearer to the least RONt."""
    sums = (low + high - 2.0 * nearest, low + high - least[0] - least[1])
    further = next((each for each in sums if abs(each) > _KEEPS_DISTANCE * (high - low)), 0.0)
    return (low, low) if further >= 0.0 else (high, high)


def _allowed(slack: Floats, rates: Floats, low: float, high: float) -> tuple[float, float]:
    """Return the part of [low, high] where slack + rates t >= 0 everywhere."""
    rising, falling = rates > _KEEPS_DISTANCE, rates < -_KEEPS_DISTANCE
    low = max(low, float(np.max(-slack[rising] / rates[rising], initial=-np.inf)))
    high = min(high, float(np.min(-slack[falling] / rates[falling], initial=np.inf)))
    return (low, high) if low <= high else (0.5 * (low + high),) * 2


def _lowest(heights: Floats, slopes: Floats, low: float, high: float) -> tuple[float, float]:
    """Return the part of [low, high] where the highest of the lines heights + slopes t is lowest."""

    def highest(place: float) -> tuple[int, float]:
        values = heights + slopes * place
        top = int(np.argmax(values))
        return top, float(values[top])

    (first, level), (last, end_level) = highest(low), highest(high)
    if slopes[last] <= 0.0:
        level = min(level, end_level)
    # Between a line that falls and one that rises: their crossing, until no third is above it.
    while slopes[first] < 0.0 < slopes[last]:
        place = float((heights[last] - heights[first]) / (slopes[first] - slopes[last]))
        top, level = highest(place)
        if level <= heights[first] + slopes[first] * place + _LEVEL:
            break
        first, last = (top, last) if slopes[top] < 0.0 else (first, top)
    return _allowed(level + _LEVEL - heights, -slopes, low, high)
