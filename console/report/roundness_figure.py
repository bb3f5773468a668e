"""Roundness plot as SVG: profiles about one circle, the zone of the tolerance, the jaws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from console.report.drawing import (
    ACCENT,
    DASHED,
    GREY,
    INK,
    PALE,
    Point,
    circle,
    label,
    line,
    path,
    picture,
    step_125,
)
from console.report.markup import Markup
from profiles.arrays import Floats

SIZE, CENTRE = 340.0, 170.0
REFERENCE, DIVISION = 76.0, 27.0
DIVISIONS = 2
RIM = REFERENCE + DIVISIONS * DIVISION
SCALE_DEG = -78.0
LEAST_STEP_UM = 0.1  # a part is not shown rounder than it can be measured


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """Deviations of M points, um, outwards from the reference circle; shape (M,) each. `bold` is the product."""

    angle_deg: Floats
    deviation_um: Floats
    bold: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Marks:
    """What is drawn beside the profiles: the zone of the tolerance, um from the circle, and the jaws.

    The zone is None where nothing is judged, `jaw_1_deg` None where the angles are not tied to the jaws.
    """

    zone_um: tuple[float, float] | None = None
    jaw_1_deg: float | None = None
    jaws: int = 0


def zone_of(profile: Profile, tolerance_um: float) -> tuple[float, float]:
    """Return the zone of a tolerance about the middle of a profile: it holds the profile if RONt is within it."""
    middle = 0.5 * float(profile.deviation_um.max() + profile.deviation_um.min())
    return middle - 0.5 * tolerance_um, middle + 0.5 * tolerance_um


def division_um(profiles: Sequence[Profile], marks: Marks) -> float:
    """Return the um of a division by which everything fits."""
    reach = max((float(np.abs(each.deviation_um).max()) for each in profiles), default=0.0)
    reach = max(reach, *(abs(each) for each in marks.zone_um or (0.0,)), LEAST_STEP_UM)
    return step_125(reach / DIVISIONS)


def roundness_figure(
    name: str, title: str, description: str, profiles: Sequence[Profile], marks: Marks, jaw_word: str
) -> Markup:
    """Return the plot; `jaw_word` is the label of a jaw, with its number added. Angles run counter-clockwise."""
    step_um = division_um(profiles, marks)

    def spot(angle_deg: float, um: float) -> Point:
        return _spot(angle_deg, REFERENCE + DIVISION * um / step_um)

    drawn = _rings(step_um)
    if marks.zone_um is not None:
        for edge_um in marks.zone_um:
            radius = REFERENCE + DIVISION * edge_um / step_um
            drawn.append(
                circle((CENTRE, CENTRE), radius, fill="none", stroke=INK, stroke_width=1, stroke_dasharray="2 3")
            )
    for each in profiles:
        points = [spot(*pair) for pair in zip(each.angle_deg.tolist(), each.deviation_um.tolist(), strict=True)]
        ink, dash = (ACCENT, None) if each.bold else (GREY, DASHED)
        drawn.append(path(points, ink, 2.0 if each.bold else 1.5, dash, closed=True))
    drawn += _numbers(step_um)
    if marks.jaw_1_deg is not None:
        drawn += _jaws(marks.jaw_1_deg, marks.jaws, jaw_word)
    return picture(name, (SIZE, SIZE), title, description, *drawn)


def _spot(angle_deg: float, radius: float) -> Point:
    angle = math.radians(angle_deg)
    return CENTRE + radius * math.cos(angle), CENTRE - radius * math.sin(angle)


def _rings(step_um: float) -> list[Markup]:
    middle = (CENTRE, CENTRE)
    rings = [
        circle(middle, REFERENCE + place * DIVISION, fill="none", stroke=GREY if place == 0 else PALE)
        for place in range(-DIVISIONS, DIVISIONS + 1)
    ]
    return [*rings, *(line(_spot(turn, REFERENCE - 2 * DIVISION), _spot(turn, RIM)) for turn in (0, 90, 180, 270))]


def _numbers(step_um: float) -> list[Markup]:
    """Return the scale, on a steep ray, where the numbers stand one below the other."""
    numbers = []
    for place in range(-DIVISIONS, DIVISIONS + 1):
        x, y = _spot(SCALE_DEG, REFERENCE + place * DIVISION)
        unit = " µm" if place == DIVISIONS else ""
        numbers.append(label((x, y + 4.0), f"{place * step_um:+.6g}{unit}" if place else "0", "start", GREY))
    return numbers


def _jaws(jaw_1_deg: float, jaws: int, word: str) -> list[Markup]:
    drawn = []
    for jaw in range(jaws):
        angle = jaw_1_deg + 360.0 * jaw / jaws
        tip, left, right = _spot(angle, RIM + 3), _spot(angle - 3.0, RIM + 12), _spot(angle + 3.0, RIM + 12)
        drawn.append(path([tip, left, right], INK, 1.5, closed=True))
        x, y = _spot(angle, RIM + 24)
        drawn.append(label((x, y + 4.0), f"{word} {jaw + 1}" if jaw == 0 else str(jaw + 1)))
    return drawn
