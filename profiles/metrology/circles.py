"""The four reference circles of ISO 12181-1 in the limacon model: deviation = R + x cos + y sin + residual.

The model is linear, so least squares is one linear fit and the other three are linear programmes with a unique
optimal value, solved exactly by the exchange of contacts. It holds while eccentricity^2 / (2 radius) is small.

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

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats, floats
from profiles.metrology.points import (
    HANDFUL,
    LARGEST_GAP_DEG,
    angle_weights,
    check_points,
    largest_gap_deg,
    narrow,
)
from profiles.problem import ProfileError, refusal_error

LEAST_SQUARES = "LSC"
MINIMUM_ZONE = "MZC"
MINIMUM_CIRCUMSCRIBED = "MCC"
MAXIMUM_INSCRIBED = "MIC"
CIRCLES = (LEAST_SQUARES, MINIMUM_ZONE, MINIMUM_CIRCUMSCRIBED, MAXIMUM_INSCRIBED)

WIDEST_SEEN_DEG = 90.0  # a quarter turn: below it no quarter is empty of points, and a zone has a start

# Fraction of the peak-to-peak deviation by which a point may be outside: far below 1e-9 um of any real part.
_OUTSIDE = 1e-13
# Weight, of 1 in all, below which a contact does not hold the circle: two others stand opposite, to 1e-9 rad.
_WEIGHTLESS = 1e-9
_MOST_EXCHANGES = 5000
_NO_STEP = 1e-12
_NEAR, _ROUNDS = 1000.0, 50
"""Excess over the tolerance that may be rounding, and how often it is met until that is taken for the end: where
many points touch alike, as those of a profile that is the same in each section, contacts of one optimum replace
each other without end."""
_SMALLEST_PIVOT = 1e-10
# Rate, per step of the centre, below which a point keeps its distance: the contacts of the circle.
_KEEPS_DISTANCE = 1e-9
_LEVEL = 1e-13  # difference of two deviations, as a fraction of the peak to peak, that is rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPoint:
    """A contact point of a circle: its index in the trace, and whether the circle touches it from outside."""

    index: int
    angle_deg: float
    outer: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceCircle:
    """A reference circle and the deviations from it, um; ISO states RONp, RONv and RONq for the least squares one.

    `kind` is one of `CIRCLES`. `deviation_um` is its radius above the nominal one; the minimum zone has two
    circles, and this is the middle between them. The centre is from the axis of measurement, x towards angle 0,
    y towards 90 deg. `contacts` are in the order of their angles, none for least squares; those of a minimum zone
    alternate outer and inner, which proves that it is the smallest.
    """

    kind: str
    centre_x_um: float
    centre_y_um: float
    deviation_um: float
    ront_um: float
    ronp_um: float
    ronv_um: float
    ronq_um: float
    contacts: tuple[ContactPoint, ...] = ()


def limacon_circle(kind: str, angle_deg: ArrayLike, deviation_um: ArrayLike) -> ReferenceCircle:
    """Return a reference circle of M points; shape (M,) each, in any order, several at one angle are allowed.

    LSC minimises the sum of squares, MZC hi - lo with all points between, MCC is the smallest R with none outside,
    MIC the largest R with none inside. Of several equally good centres it is the one with the least RONt, then the
    one nearest to that of least squares. Raises as `profiles.metrology.points.checked`.
    """
    return seen_circle(kind, *check_points(angle_deg, deviation_um))


def seen_circle(kind: str, angle: Floats, deviation: Floats) -> ReferenceCircle:
    """Return `limacon_circle` of points measured all round, as seen from another centre.

    From there a gap may be wider than from the axis of measurement: that is due to the centre, not the data.
    Raises `ProfileError`: `trace.narrow_angles`, it is so wide that no circle of them has its centre there.
    """
    gap_deg = largest_gap_deg(angle)
    if gap_deg >= WIDEST_SEEN_DEG:
        raise ProfileError(narrow(gap_deg, WIDEST_SEEN_DEG))
    direction = _direction(angle)
    cosine, sine = direction
    weights = angle_weights(angle)
    mean_um, x_um, y_um = _least_squares(direction, deviation, weights)
    # Only the residuals of least squares go into the programme: small numbers lose no digits.
    left = deviation - mean_um - x_um * cosine - y_um * sine
    contacts: tuple[ContactPoint, ...] = ()
    if kind != LEAST_SQUARES:
        dx_um, dy_um, contacts = _extreme(kind, angle, direction, left)
        left = left - dx_um * cosine - dy_um * sine
        x_um, y_um = x_um + dx_um, y_um + dy_um
    highest, lowest = float(left.max()), float(left.min())
    shift_um = {
        LEAST_SQUARES: 0.0,
        MINIMUM_ZONE: (highest + lowest) / 2,
        MINIMUM_CIRCUMSCRIBED: highest,
        MAXIMUM_INSCRIBED: lowest,
    }[kind]
    return ReferenceCircle(
        kind=kind,
        centre_x_um=x_um,
        centre_y_um=y_um,
        deviation_um=mean_um + shift_um,
        ront_um=highest - lowest,
        ronp_um=highest - shift_um,
        ronv_um=0.0 + shift_um - lowest,
        ronq_um=math.sqrt(float(np.average((left - shift_um) ** 2, weights=weights))),
        contacts=contacts,
    )


def least_squares(angle_deg: Floats, deviation_um: Floats) -> tuple[float, float, float]:
    """Return mean, x and y of the least squares circle, um; points weigh by their angle."""
    return _least_squares(_direction(angle_deg), deviation_um, angle_weights(angle_deg))


def _least_squares(direction: Floats, deviation_um: Floats, weights: Floats) -> tuple[float, float, float]:
    """Solve the normal equations twice: the exchange works on the residuals, down to the last digit."""
    design = np.vstack((np.ones(deviation_um.size), direction))
    weighed = design * weights
    normal = weighed @ design.T
    solution = np.linalg.solve(normal, weighed @ deviation_um)
    solution += np.linalg.solve(normal, weighed @ (deviation_um - solution @ design))
    return float(solution[0]), float(solution[1]), float(solution[2])


def _direction(angle_deg: Floats) -> Floats:
    """Return cosines and sines, shape (2, M)."""
    theta = np.radians(angle_deg)
    return np.stack((np.cos(theta), np.sin(theta)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optimum:
    """Contacts (columns of the basis), their weights (>= 0), and the prices y of the rows: the circle itself."""

    basis: NDArray[np.intp]
    weights: Floats
    prices: Floats


def exchange_basis(
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
    careful, near = False, 0
    for _ in range(_MOST_EXCHANGES):
        inverse = np.linalg.inv(columns[:, basis])
        weights, prices = inverse @ rhs, gains[basis] @ inverse
        excess = excess_of(prices)
        excess[basis] = 0.0
        entering = int(np.argmax(excess > tolerance)) if careful else int(np.argmax(excess))
        near += excess[entering] <= _NEAR * tolerance
        if excess[entering] <= tolerance or near > _ROUNDS:
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
    raise refusal_error("trace.no_circle", value=f"{_MOST_EXCHANGES}", limit="0")


def settle_prices(
    columns: Floats, gains: Floats, prices: Floats, held: NDArray[np.intp], *, one_sided: bool
) -> Floats:
    """Return the prices of the position chosen among all optima; the given ones where there is no other.

    `columns` (m, n), `gains` (n,) and `prices` (m,) are those of `exchange_basis`: columns^T
    prices >= gains, and the last two prices are the centre from that of least squares. `held` are the contacts
    with a weight. `one_sided` is a circumscribed or inscribed circle, whose RONt depends on the position.
    Several heights at one angle may let a zone slide in two directions; it then stays where it is.
    """
    free = len(prices) - held.size
    if free != 1:
        return prices
    along = np.linalg.svd(columns[:, held].T)[2][-1]
    slack, rates = np.maximum(columns.T @ prices - gains, 0.0), columns.T @ along
    low, high = _allowed_range(slack, rates, -np.inf, np.inf)
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


def _allowed_range(slack: Floats, rates: Floats, low: float, high: float) -> tuple[float, float]:
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
    return _allowed_range(level + _LEVEL - heights, -slopes, low, high)


def _extreme(
    kind: str, angle_deg: Floats, direction: Floats, left_um: Floats
) -> tuple[float, float, tuple[ContactPoint, ...]]:
    """Return the shift of the centre in x and y, and the contacts of the circle; `direction` is (2, M)."""
    span_um = float(np.ptp(left_um))
    if span_um == 0.0:
        return 0.0, 0.0, ()
    size, gains, sides = angle_deg.size, left_um / span_um, 1
    if kind == MINIMUM_ZONE:  # columns of outer contacts, then of inner ones
        columns = np.zeros((4, 2 * size))
        columns[0, :size] = columns[1, size:] = 1.0
        columns[2:, :size], columns[2:, size:] = direction, -direction
        gains, sides = np.concatenate((gains, -gains)), 2
        basis = _crossing(direction, left_um) + np.array([0, size, 0, size])
    else:
        sign = 1.0 if kind == MINIMUM_CIRCUMSCRIBED else -1.0
        columns, gains, basis = (
            np.vstack((np.ones(size), direction)),
            sign * gains,
            _enclosing(angle_deg, direction),
        )
    rhs = np.zeros(columns.shape[0])
    rhs[:sides] = 1.0

    def excess_of(prices: Floats) -> Floats:
        over = gains[:size] - prices[-2:] @ columns[-2:, :size] - prices[0]
        # Inner contacts are the same points from the other side: prices[0] + prices[1] is the width of the zone.
        return over if sides == 1 else np.concatenate((over, -over - (prices[0] + prices[1])))

    optimum = exchange_basis(columns, gains, rhs, basis, tolerance=_OUTSIDE, excess_of=excess_of)
    touching = optimum.basis[optimum.weights > _WEIGHTLESS]
    place = settle_prices(columns, gains, optimum.prices, touching, one_sided=kind != MINIMUM_ZONE)
    x, y = place[-2:] * (-span_um if kind == MAXIMUM_INSCRIBED else span_um)
    outer = touching < size if kind == MINIMUM_ZONE else np.full(touching.size, kind == MINIMUM_CIRCUMSCRIBED)
    found = [
        ContactPoint(index=int(i), angle_deg=float(angle_deg[i]), outer=bool(o))
        for i, o in zip(touching % size, outer, strict=True)
    ]
    return float(x), float(y), tuple(sorted(found, key=lambda contact: contact.angle_deg % 360.0))


def _crossing(direction: Floats, left_um: Floats) -> NDArray[np.intp]:
    """Return the highest, lowest, highest and lowest point of four quarters: two crossing chords support a zone.

    No quarter is empty: no gap between points is that large.
    """
    cosine, sine = direction
    wide = np.abs(cosine) >= np.abs(sine)
    quarters = (wide & (cosine > 0), ~wide & (sine > 0), wide & (cosine < 0), ~wide & (sine < 0))
    heights = (left_um, -left_um, left_um, -left_um)
    found = [np.where(quarter, high, -np.inf).argmax() for quarter, high in zip(quarters, heights, strict=True)]
    return np.array(found, dtype=np.intp)


def _enclosing(angle_deg: Floats, direction: Floats) -> NDArray[np.intp]:
    """Return three points around the centre that the angles are seen from.

    Those that best divide the turn enclose it where no gap is above `LARGEST_GAP_DEG`; else the first point
    does, with its two neighbours across.
    """
    if largest_gap_deg(angle_deg) <= LARGEST_GAP_DEG:
        target = 2 * math.pi * np.arange(3) / 3
        nearest = np.argmax(np.column_stack((np.cos(target), np.sin(target))) @ direction, axis=1)
        return np.asarray(nearest, dtype=np.intp)
    ahead = np.mod(angle_deg - angle_deg[0], 360.0)
    across = np.where(ahead <= 180.0, ahead, -np.inf).argmax(), np.where(ahead > 180.0, ahead, np.inf).argmin()
    return np.array([0, *across], dtype=np.intp)
