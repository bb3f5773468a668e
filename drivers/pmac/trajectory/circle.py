"""CIRCLE1 and CIRCLE2: the arc in space, and the resulting motion of each motor.

Source: PMAC User Manual, circular interpolation: the sense is right-handed about the normal vector; a change of
radius is spread smoothly over the arc; a centre at distance 0 is an error; axes outside the plane move linearly.
Software Reference, Ix96: the tolerance by which an arc given by its radius may be too long (0: any); I90 (Isx97):
an angle below it is a full turn more. Axis positions are user units, motors counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.pmac.axes import AxisDefinition
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.requests import CircleRequest
from drivers.pmac.trajectory.pieces import Vector

Point = tuple[float, float, float]

LEAST_ARC = 2.0**-20  # The least angle of an arc, in half turns, where I90 (Isx97) is 0


class CircleRadiusError(PmacError):
    """A run-time error with a status bit of its own: an arc without a radius, or with one that is too short."""

    def __init__(self, detail: str) -> None:
        super().__init__(ErrorCode.DATA_ERROR, detail)


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """The path of the motors over a fraction u of its length, 0 to 1, as a displacement from its start.

    `sweep` is the angle (rad, about the normal) and `growth` the radius at the end over that at the start.
    `cosine` and `sine` are the two radii that span the arc, `straight` is the linear part, all counts. `length` is
    that of the path in user units.
    """

    sweep: float
    growth: float
    cosine: Vector
    sine: Vector
    straight: Vector
    length: float

    def displacement(self, fraction: float) -> Vector:
        """Return the displacement from the start of the arc, counts."""
        size = 1.0 + (self.growth - 1.0) * fraction
        along, across = size * math.cos(self.sweep * fraction), size * math.sin(self.sweep * fraction)
        return tuple(
            (along - 1.0) * a + across * b + fraction * s
            for a, b, s in zip(self.cosine, self.sine, self.straight, strict=True)
        )

    def slope(self, fraction: float) -> Vector:
        """Return the derivative of the displacement by the fraction of the path, counts."""
        grows, size = self.growth - 1.0, 1.0 + (self.growth - 1.0) * fraction
        cosine, sine = math.cos(self.sweep * fraction), math.sin(self.sweep * fraction)
        along = grows * cosine - size * self.sweep * sine
        across = grows * sine + size * self.sweep * cosine
        return tuple(
            along * a + across * b + s for a, b, s in zip(self.cosine, self.sine, self.straight, strict=True)
        )


def arc_of(
    request: CircleRequest,
    start: Mapping[str, float],
    definitions: Sequence[AxisDefinition],
    distance: Vector,
    *,
    radius_limit: float = 0.0,
    least_arc: float = 0.0,
) -> Arc:
    """Return the arc of a request that begins at `start`; `distance` is that of each motor to its end, counts.

    `radius_limit` is Ix96 (user units), `least_arc` I90 or Isx97 (half turns).

    Raises:
        CircleRadiusError: a run-time error, no such arc exists.
        PmacError: the normal has no direction.
    """
    size = _size(request.normal)
    if not size > 0.0:
        raise PmacError(ErrorCode.DATA_ERROR, "the normal of a circle has no direction")
    normal = _times(1.0 / size, request.normal)
    move = _minus(_point(request.targets), _point(start))
    axial = _dot(move, normal)
    chord = _minus(move, _times(axial, normal))
    center = _center(request, chord, normal, radius_limit)
    first, last = _times(-1.0, center), _minus(chord, center)
    if not (_size(first) > 0.0 and _size(last) > 0.0):
        raise CircleRadiusError("a circle without a radius")
    turn = math.tau if request.clockwise else -math.tau
    sweep = math.atan2(_dot(normal, _cross(first, last)), _dot(first, last))
    if sweep * turn < 0.0:
        sweep += turn
    if request.center is not None and abs(sweep) < (least_arc or LEAST_ARC) * math.pi:
        sweep += turn
    growth = _size(last) / _size(first)
    cosine, sine = _counts(definitions, first), _counts(definitions, _cross(normal, first))
    along, across = growth * math.cos(sweep) - 1.0, growth * math.sin(sweep)
    # The remainder in the straight part makes the end exact, whatever the rounding of the radii.
    straight = tuple(d - along * a - across * b for d, a, b in zip(distance, cosine, sine, strict=True))
    length = math.hypot(0.5 * abs(sweep) * (_size(first) + _size(last)), axial)
    return Arc(sweep=sweep, growth=growth, cosine=cosine, sine=sine, straight=straight, length=length)


def chord_length(request: CircleRequest, start: Mapping[str, float]) -> float:
    """Return the straight distance in X, Y and Z, user units."""
    return _size(_minus(_point(request.targets), _point(start)))


def _center(request: CircleRequest, chord: Point, normal: Point, radius_limit: float) -> Point:
    """Return the vector from the start to the centre, in the plane."""
    if request.center is not None:
        given = _point(request.center)
        return _minus(given, _times(_dot(given, normal), normal))
    radius, distance = request.radius or 0.0, _size(chord)
    if radius == 0.0 or distance == 0.0:
        raise CircleRadiusError(f"an arc of radius {radius:g} over a distance of {distance:g}")
    beyond = distance - 2.0 * abs(radius)
    if beyond >= 0.0:
        if 0.0 < radius_limit < beyond:
            text = f"an arc of radius {radius:g} over a distance of {distance:g}, limit {radius_limit:g}"
            raise CircleRadiusError(text)
        return _times(abs(radius) / distance, chord)
    height = math.sqrt(radius * radius - 0.25 * distance * distance)
    side = 1.0 if request.clockwise == (radius > 0.0) else -1.0
    left = _cross(normal, chord)
    return _minus(_times(0.5, chord), _times(-side * height / distance, left))


def _counts(definitions: Sequence[AxisDefinition], vector: Point) -> Vector:
    distances = dict(zip("XYZ", vector, strict=True))
    return tuple(definition.distance(distances) for definition in definitions)


def _point(positions: Mapping[str, float]) -> Point:
    return positions.get("X", 0.0), positions.get("Y", 0.0), positions.get("Z", 0.0)


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _times(factor: float, a: Point) -> Point:
    return factor * a[0], factor * a[1], factor * a[2]


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Point, b: Point) -> Point:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _size(a: Point) -> float:
    return math.hypot(*a)
