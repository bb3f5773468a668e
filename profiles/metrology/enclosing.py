"""The smallest circle around points in a plane: it rests on two points, or on three.

With two contacts its centre is fixed across their line only by the curvature of the circle, which a linear
model lacks; so it is found by exchange: the point that is furthest outside joins the contacts, and the smallest
circle round these few is the next one. The radius grows with each step, so the search terminates.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from profiles.arrays import Floats

# Fraction of the radius that a point may be outside: 3e-8 um of 26 mm.
_OUTSIDE = 1e-12


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
