"""Reference circles of points in a plane, and of parts too far off the axis for the limacon model.

The distance from a centre is not linear in it. Each step linearises it about the present centre (Gauss-Newton for
least squares, sequential linear programming for zone and inscribed circle); those of the last two are shortened
until the true objective drops. Least squares and zone have one optimum near a round part. The circumscribed circle
is unique; with two contacts its centre is fixed across their line only by the curvature of the circle, which a
linear model lacks. So it is found exactly by exchange: the point that is furthest outside joins the contacts, and
the smallest circle round these few is the next one. The radius grows with each step, so the search terminates.

The inscribed circle may have several positions, so it is searched from the centre of least squares and from a ring
around it that turns with the part. In the middle of an oval it rests on two points, and can still grow by slipping
between each and its neighbour: by (ovality x step of the angles, rad)^2 / diameter, 2e-7 um for 55 um and 0.1 deg
on 52 mm, with a RONt that is 0.1 um more. ISO 12181-1 leaves the choice open. Here circles within `SAME_UM` of the
largest are equal, and the one with the least RONt is taken; of two that mirror each other, either.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.metrology.circles import (
    CIRCLES,
    LEAST_SQUARES,
    MAXIMUM_INSCRIBED,
    MINIMUM_CIRCUMSCRIBED,
    ContactPoint,
    ReferenceCircle,
    limacon_circle,
    seen_circle,
)
from profiles.metrology.points import angle_weights, check_points
from profiles.problem import ProfileError

_MOST_STEPS = 50
_MOST_HALVINGS = 20
_STILL = 1e-13  # fraction of the radius below which a step counts as zero: 3e-9 um on a radius of 26 mm
_STARTS = 6
SAME_UM = 1e-3  # difference of the radii of two inscribed circles that no roundness instrument resolves


def geometric_circle(
    kind: str, x_um: ArrayLike, y_um: ArrayLike, start: tuple[float, float] | None = None
) -> ReferenceCircle:
    """Return a reference circle of points x, y (um, shape (M,) each) by their true distances.

    `deviation_um` of the circle is its radius. `start` is a point inside the part, by default the middle of its
    extent. Raises as `profiles.metrology.points.checked`, of the angles about the start.
    """
    x, y = floats(x_um), floats(y_um)
    first = (0.5 * float(x.max() + x.min()), 0.5 * float(y.max() + y.min())) if start is None else start
    check_points(*polar(x, y, first))
    if kind == MINIMUM_CIRCUMSCRIBED:
        return _minimum_circumscribed_circle(x, y)
    if kind != MAXIMUM_INSCRIBED:
        return _descend_to_circle(kind, x, y, first)
    return _maximum_inscribed_circle(x, y, _descend_to_circle(LEAST_SQUARES, x, y, first))


def polar(x_um: Floats, y_um: Floats, centre: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return angles (deg, in [0, 360)) and distances (um) of points about a centre; shape (M,) each."""
    dx, dy = x_um - centre[0], y_um - centre[1]
    return np.mod(np.degrees(np.arctan2(dy, dx)), 360.0), np.hypot(dx, dy)


def circles_about_axis(
    angle_deg: Floats, deviation_um: Floats, radius_um: float | None
) -> tuple[ReferenceCircle, ...]:
    """Return the four circles of a centred profile: by true distances with its radius, as limacons without."""
    if radius_um is None:
        return tuple(limacon_circle(kind, angle_deg, deviation_um) for kind in CIRCLES)
    theta, distance = np.radians(angle_deg), deviation_um + radius_um
    x, y = distance * np.cos(theta), distance * np.sin(theta)
    found = (geometric_circle(kind, x, y, (0.0, 0.0)) for kind in CIRCLES)
    return tuple(replace(circle, deviation_um=circle.deviation_um - radius_um) for circle in found)


def _minimum_circumscribed_circle(x: Floats, y: Floats) -> ReferenceCircle:
    centre, touching = smallest_enclosing(x, y)
    angle, distance = polar(x, y, centre)
    radius_um, lowest_um = float(distance.max()), float(distance.min())
    found = [ContactPoint(index=i, angle_deg=float(angle[i]), outer=True) for i in touching]
    return ReferenceCircle(
        kind=MINIMUM_CIRCUMSCRIBED,
        centre_x_um=centre[0],
        centre_y_um=centre[1],
        deviation_um=radius_um,
        ront_um=radius_um - lowest_um,
        ronp_um=0.0,
        ronv_um=radius_um - lowest_um,
        ronq_um=math.sqrt(float(np.average((radius_um - distance) ** 2, weights=angle_weights(angle)))),
        contacts=tuple(sorted(found, key=lambda contact: contact.angle_deg)),
    )


def _maximum_inscribed_circle(x: Floats, y: Floats, middle: ReferenceCircle) -> ReferenceCircle:
    """Return the largest inscribed circle; `middle` is that of least squares."""
    centre = (middle.centre_x_um, middle.centre_y_um)
    angle, distance = polar(x, y, centre)
    around = np.radians(angle[np.argmin(distance)] + np.arange(_STARTS) * (360.0 / _STARTS))
    ring = zip(np.cos(around).tolist(), np.sin(around).tolist(), strict=True)
    starts = [centre, *((centre[0] + middle.ront_um * c, centre[1] + middle.ront_um * s) for c, s in ring)]
    found: list[ReferenceCircle] = []
    for each in starts:
        # A position near the edge of the part, or outside, sees gaps that the data do not have: not a start.
        with suppress(ProfileError):
            found.append(_descend_to_circle(MAXIMUM_INSCRIBED, x, y, each))
    if not found:
        return _descend_to_circle(MAXIMUM_INSCRIBED, x, y, centre)  # reports why
    largest_um = max(circle.deviation_um for circle in found)
    return min((c for c in found if c.deviation_um >= largest_um - SAME_UM), key=lambda circle: circle.ront_um)


def _descend_to_circle(kind: str, x: Floats, y: Floats, start: tuple[float, float]) -> ReferenceCircle:
    circle = _move_circle(seen_circle(kind, *polar(x, y, start)), start)
    centre, reached = start, math.inf
    for _ in range(_MOST_STEPS):
        step = (circle.centre_x_um - centre[0], circle.centre_y_um - centre[1])
        if math.hypot(*step) <= _STILL * abs(circle.deviation_um):
            break
        # Whole steps: points weigh by their angle about the centre, so that no sum has to drop.
        if kind == LEAST_SQUARES:
            centre = (circle.centre_x_um, circle.centre_y_um)
            circle = _move_circle(seen_circle(kind, *polar(x, y, centre)), centre)
            continue
        fractions = (0.5**k for k in range(_MOST_HALVINGS))
        tried = ((centre[0] + fraction * step[0], centre[1] + fraction * step[1]) for fraction in fractions)
        judged = ((_objective(kind, x, y, each), each) for each in tried)
        value, place = next(((v, p) for v, p in judged if v < reached), (reached, centre))
        if value >= reached:
            break
        reached, centre = value, place
        circle = _move_circle(seen_circle(kind, *polar(x, y, centre)), centre)
    return circle


def _move_circle(circle: ReferenceCircle, origin: tuple[float, float]) -> ReferenceCircle:
    return replace(circle, centre_x_um=circle.centre_x_um + origin[0], centre_y_um=circle.centre_y_um + origin[1])


def _objective(kind: str, x: Floats, y: Floats, centre: tuple[float, float]) -> float:
    """Return what the circle of this kind minimises, um."""
    distance = np.hypot(x - centre[0], y - centre[1])
    if kind == MAXIMUM_INSCRIBED:
        return -float(distance.min())
    return float(np.ptp(distance))


_OUTSIDE = 1e-12  # fraction of the radius that a point may be outside: 3e-8 um of 26 mm


def smallest_enclosing(x_um: Floats, y_um: Floats) -> tuple[tuple[float, float], tuple[int, ...]]:
    """Return the centre, um, and the contacts as indices of the points, shape (M,) each."""
    points = x_um + 1j * y_um
    contacts: tuple[int, ...] = (int(np.argmax(np.abs(points - points.mean()))),)
    centre, radius_um = complex(points[contacts[0]]), 0.0
    while True:
        distance = np.abs(points - centre)
        furthest = int(np.argmax(distance))
        if distance[furthest] <= radius_um * (1.0 + _OUTSIDE):
            break
        few = points[[*contacts, furthest]]
        # The new point is on the next circle, with one or two of the others. Whether a circle holds them all would
        # be a question of rounding: of these centres that of the smallest circle is the one that reaches least.
        groups = [(*g, furthest) for size in (1, 2) for g in combinations(contacts, size)]
        tried = [(_middle([complex(points[i]) for i in group]), group) for group in groups]
        reaches = [float(np.abs(few - middle).max()) for middle, _ in tried]
        least = int(np.argmin(reaches))
        if reaches[least] <= radius_um:
            break
        (centre, contacts), radius_um = tried[least], reaches[least]
    return (centre.real, centre.imag), contacts


def _middle(points: list[complex]) -> complex:
    """Return the centre of the circle on two points as a diameter, or through three, infinity if in line."""
    if len(points) == 2:
        return (points[0] + points[1]) / 2
    b, c = points[1] - points[0], points[2] - points[0]
    area = 2 * (b.real * c.imag - b.imag * c.real)
    if area == 0.0:
        return complex(math.inf, 0.0)
    return points[0] + 1j * (abs(c) ** 2 * b - abs(b) ** 2 * c) / area
