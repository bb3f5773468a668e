"""Exchange of contact points: a linear programme with few rows and many columns, solved from a few of them.

A minimum zone, circumscribed or inscribed circle rests on three or four of thousands of points. The programme is
the dual one: weights on the points, max gains w subject to columns w = rhs, w >= 0, by the primal simplex method.
Its basis is the set of contacts; in each step the point that is furthest outside replaces one of them. Where a
step brings nothing, Bland's rule (lowest index in, lowest index out) prevents cycling.

Two exactly opposite points, such as the maxima of an oval, fix a circumscribed or inscribed circle in one
direction only: within bounds every position is equally good, and a programme would end at an arbitrary one. ISO
12181-1 leaves it open. Here it is the position with the least RONt and, where that is not unique either, the one
nearest to the centre of least squares: both turn with the part, and for an oval they are its middle. A minimum
zone that may slide has one RONt; its centre is the nearest one, too. A handful of points is not a profile: nothing
is known between them. There a circumscribed or inscribed circle slides until a third point stops it, the shorter
way from the centre of least squares, as in published examples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats, floats
from profiles.problem import refused

_MOST_EXCHANGES = 5000
_NO_STEP = 1e-12
_SMALLEST_PIVOT = 1e-10
# Rate, per step of the centre, below which a point keeps its distance: the contacts of the circle.
_KEEPS_DISTANCE = 1e-9
HANDFUL = 32  # fewer points than this are not a profile
_LEVEL = 1e-13  # difference of two deviations, as a fraction of the peak to peak, that is rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optimum:
    """Contacts (columns of the basis), their weights (>= 0), and the prices y of the rows: the circle itself."""

    basis: NDArray[np.intp]
    weights: Floats
    prices: Floats


def exchanged(
    columns: Floats,
    gains: Floats,
    rhs: Floats,
    basis: NDArray[np.intp],
    *,
    tolerance: float,
    excess_of: Callable[[Floats], Floats],
) -> Optimum:
    """Return the optimum of max gains w, columns w = rhs, w >= 0, from a feasible basis.

    `columns` is (m, n), `gains` (n,), `rhs` (m,), `basis` m column indices. `excess_of` prices (m,) is by how much
    gains exceed prices columns (n,), and takes nearly all of the time; at the optimum nothing exceeds `tolerance`
    (in the unit of the gains). Raises `ProfileError`: `trace.no_circle`, the exchange does not end, which was
    never observed on a sound profile.
    """
    basis = basis.copy()
    careful = False
    for _ in range(_MOST_EXCHANGES):
        inverse = np.linalg.inv(columns[:, basis])
        weights, prices = inverse @ rhs, gains[basis] @ inverse
        excess = excess_of(prices)
        excess[basis] = 0.0
        entering = int(np.argmax(excess > tolerance)) if careful else int(np.argmax(excess))
        if excess[entering] <= tolerance:
            return Optimum(basis=basis, weights=np.maximum(weights, 0.0), prices=prices)
        direction = inverse @ columns[:, entering]
        rows = np.flatnonzero(direction > _SMALLEST_PIVOT)
        if rows.size == 0:
            break
        ratios = np.maximum(weights[rows], 0.0) / direction[rows]
        step = float(ratios.min())
        tied = rows[ratios <= step + _NO_STEP]
        leaving = tied[np.argmin(basis[tied])] if careful else tied[np.argmax(direction[tied])]
        basis[leaving] = entering
        careful = step <= _NO_STEP
    raise refused("trace.no_circle", value=f"{_MOST_EXCHANGES}", limit="0")


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
