"""The four reference circles of ISO 12181-1 in the limacon model: deviation = R + x cos + y sin + residual.

The model is linear, so least squares is one linear fit and the other three are linear programmes with a unique
optimal value, solved exactly by the exchange of contacts. Where several centres have that value (an oval), the
one with the least RONt is taken and, if not unique, the one nearest to the least squares centre: see
`profiles.metrology.exchange`. The model holds while eccentricity^2 / (2 radius) is small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats
from profiles.metrology.exchange import exchanged, settled
from profiles.metrology.points import LARGEST_GAP_DEG, checked, largest_gap_deg, narrow
from profiles.problem import ProfileError

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
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
    contacts: tuple[Contact, ...] = ()


def limacon_circle(kind: str, angle_deg: ArrayLike, deviation_um: ArrayLike) -> ReferenceCircle:
    """Return a reference circle of M points; shape (M,) each, in any order, several at one angle are allowed.

    LSC minimises the sum of squares, MZC hi - lo with all points between, MCC is the smallest R with none outside,
    MIC the largest R with none inside. Of several equally good centres it is the one with the least RONt, then the
    one nearest to that of least squares. Raises as `profiles.metrology.points.checked`.
    """
    return seen_circle(kind, *checked(angle_deg, deviation_um))


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
    mean_um, x_um, y_um = _least_squares(direction, deviation)
    # Only the residuals of least squares go into the programme: small numbers lose no digits.
    left = deviation - mean_um - x_um * cosine - y_um * sine
    contacts: tuple[Contact, ...] = ()
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
        ronq_um=math.sqrt(float(np.mean((left - shift_um) ** 2))),
        contacts=contacts,
    )


def least_squares(angle_deg: Floats, deviation_um: Floats) -> tuple[float, float, float]:
    """Return mean, x and y of the least squares circle, um; exact for unequal angles, too."""
    return _least_squares(_direction(angle_deg), deviation_um)


def _least_squares(direction: Floats, deviation_um: Floats) -> tuple[float, float, float]:
    """Solve the normal equations twice: the exchange works on the residuals, down to the last digit."""
    design = np.vstack((np.ones(deviation_um.size), direction))
    normal = design @ design.T
    solution = np.linalg.solve(normal, design @ deviation_um)
    solution += np.linalg.solve(normal, design @ (deviation_um - solution @ design))
    return float(solution[0]), float(solution[1]), float(solution[2])


def _direction(angle_deg: Floats) -> Floats:
    """Return cosines and sines, shape (2, M)."""
    theta = np.radians(angle_deg)
    return np.stack((np.cos(theta), np.sin(theta)))


def _extreme(
    kind: str, angle_deg: Floats, direction: Floats, left_um: Floats
) -> tuple[float, float, tuple[Contact, ...]]:
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

    optimum = exchanged(columns, gains, rhs, basis, tolerance=_OUTSIDE, excess_of=excess_of)
    touching = optimum.basis[optimum.weights > _WEIGHTLESS]
    place = settled(columns, gains, optimum.prices, touching, one_sided=kind != MINIMUM_ZONE)
    x, y = place[-2:] * (-span_um if kind == MAXIMUM_INSCRIBED else span_um)
    outer = touching < size if kind == MINIMUM_ZONE else np.full(touching.size, kind == MINIMUM_CIRCUMSCRIBED)
    found = [
        Contact(index=int(i), angle_deg=float(angle_deg[i]), outer=bool(o))
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
