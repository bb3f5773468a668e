"""Cylindricity of a part in sections or points: the reference cylinders of ISO 12180-1.

Each section is filtered round by the Gaussian filter of ISO 16610-21. Along the part none is applied unless it is
asked for and the heights are near enough: then the Gaussian one with local straight lines, which leaves a taper
and the ends as they are (ISO 16610-28). The cylinders are fitted to deviation = R + (x + a z) cos + (y + b z) sin,
which is linear: one by least squares, the others as linear programmes by the exchange of contacts
(`profiles.metrology.circles`). If the radius of the part is known, the fit is repeated with the exact distances
from its axis until that stays.
Angles in degrees, z in mm, deviations and offsets in um.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats, floats
from profiles.metrology.circles import Optimum, exchange_basis, limacon_circle
from profiles.metrology.conformity import SectionForm
from profiles.metrology.length_causes import CAUSES, LengthCause, length_causes
from profiles.metrology.points import POINTS_PER_UNDULATION, angle_weights, gaussian_weights
from profiles.metrology.profile_filters import FilterKind
from profiles.problem import Problem, ProfileError, refusal_error
from profiles.roundness import profile_of
from profiles.trace_files.sections import (
    BIRD_CAGE,
    HEIGHT,
    HELIX,
    SECTIONS,
    SurfacePoints,
    TraceSection,
    generatrix_of,
)

LEAST_SQUARES = "LSCY"
MINIMUM_ZONE = "MZCY"
MINIMUM_CIRCUMSCRIBED = "MCCY"
MAXIMUM_INSCRIBED = "MICY"
CYLINDERS = (LEAST_SQUARES, MINIMUM_ZONE, MINIMUM_CIRCUMSCRIBED, MAXIMUM_INSCRIBED)

UNEVEN = 2.0
LEAST_SPAN = 0.5  # of the length of a cut: sections closer to each other do not show its form. A choice.
LEAST_SECTIONS = 3  # ISO 1101: two sections are a cone of any shape between them
TURN_DEG = np.arange(0.0, 360.0)  # where there is a generatrix
_EXACT = 1.0 + 1e-9  # a cut-off of exactly the limit
_STAYS_UM = 1e-9
_MOST_TURNS = 20
_OUTSIDE = 1e-12
_TINY = 1e-11
_OTHER_SIDE = np.array([[1.0], [-1.0], [-1.0], [-1.0], [-1.0]])
_UNUSED = 100.0
"""Price of a contact that is none, in peak-to-peak deviations: a start for the exchange."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartSection:
    """A roundness profile at one height: M angles (deg) and deviations (um), and its z (mm)."""

    z_mm: float
    angle_deg: Floats
    deviation_um: Floats


def part_section(section: TraceSection) -> PartSection:
    """Return a section of a file. `section` states its height, as one of several does."""
    assert section.z_mm is not None
    trace = section.trace
    return PartSection(z_mm=section.z_mm, angle_deg=trace.angle_deg, deviation_um=trace.deviation_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceCylinder:
    """A reference cylinder; its axis passes `centre_x_um`, `centre_y_um` in the middle of the sections.

    `tilt_x_um_per_mm` and `tilt_y_um_per_mm` are its slopes, `deviation_um` its radius above the nominal one (the
    middle of both for the minimum zone). CYLt is peak to valley, CYLp, CYLv and CYLq about the cylinder.
    """

    kind: str
    centre_x_um: float
    centre_y_um: float
    tilt_x_um_per_mm: float
    tilt_y_um_per_mm: float
    deviation_um: float
    cylt_um: float
    cylp_um: float
    cylv_um: float
    cylq_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderResult:
    """The form of a part over its length.

    `cylinders` has one of each kind. A line through the mean radii of the sections rises by `taper_um` over the
    evaluated length (radius, positive if it grows with z); they deviate from it by `crown_um`, peak to valley. The
    centres of the sections lie within a diameter of `axis_straightness_um` about their line, the worst generatrix
    within `generatrix_straightness_um`, peak to valley, about its own. All lines are of least squares.
    `causes` are why the sections differ, largest first.

    `strategy` is how it was extracted (ISO 12180-2). Of `count` points that are no sections these are unknown; a
    bird-cage has generatrices. The filter round is of `filter_kind`, that along is Gaussian, with their cut-offs
    (UPR and mm), or None.
    """

    sections: tuple[SectionForm, ...]
    filter_upr: float | None
    cylinders: tuple[ReferenceCylinder, ...]
    taper_um: float
    crown_um: float | None
    axis_straightness_um: float | None
    generatrix_straightness_um: float | None
    causes: tuple[LengthCause, ...]
    strategy: str = SECTIONS
    filter_along_mm: float | None = None
    filter_kind: FilterKind = FilterKind.GAUSS
    count: int = 0

    def event(self) -> dict[str, object]:
        """Return what records and results in JSON have: the sections, CYLt (MZCY) and what it consists of."""
        names = ("taper_um", "crown_um", "axis_straightness_um", "generatrix_straightness_um")
        lines = {name: getattr(self, name) for name in names}
        return {
            "sections": [each.fields() for each in self.sections],
            "CYLt_um": self.cylt_um,
            **lines,
            CAUSES: [asdict(each) for each in self.causes],
            "extraction": self.strategy,
            "filter_along_mm": self.filter_along_mm,
            **({} if self.filter_kind is FilterKind.GAUSS else {"filter_kind": self.filter_kind}),
        }

    @property
    def cylt_um(self) -> float:
        """CYLt of the minimum zone (ISO 1101)."""
        return self.cylinder(MINIMUM_ZONE).cylt_um

    @property
    def worst(self) -> SectionForm:
        """The section that is least round."""
        return max(self.sections, key=lambda each: each.ront_um)

    @property
    def is_uneven(self) -> bool:
        """Whether a section is much less round than that in the middle of the others (twice, a choice)."""
        middle_mm = 0.5 * (self.sections[0].z_mm + self.sections[-1].z_mm)
        middle = min(self.sections, key=lambda each: abs(each.z_mm - middle_mm))
        return self.worst.ront_um > UNEVEN * middle.ront_um

    def cylinder(self, kind: str) -> ReferenceCylinder:
        """Return the reference cylinder of that kind ("LSCY", "MZCY", "MCCY" or "MICY")."""
        return next(each for each in self.cylinders if each.kind == kind)


def cylinder_event(whole: CylinderResult | None) -> dict[str, object]:
    """Return the form of a part for records and results in JSON; not known: no sections, and CYLt is None."""
    return {"sections": [], "CYLt_um": None} if whole is None else whole.event()


def few_sections(count: int, key: str = HEIGHT) -> Problem:
    """Return why so few sections have no form over the length."""
    return Problem(code="trace.few_sections", key=key, value=str(count), limit=f">= {LEAST_SECTIONS}")


def evaluate_cylinder(
    sections: Sequence[PartSection],
    *,
    radius_mm: float | None = None,
    filter_upr: float | None = 50.0,
    filter_along_mm: float | None = None,
    filter_kind: FilterKind = FilterKind.GAUSS,
) -> CylinderResult:
    """Return the cylindricity of sections of one part, which share the axis of measurement and its angle 0.

    Raises `ProfileError`: `trace.few_sections`, fewer than three heights; `trace.filter_along`, they are too far
    apart for that cut-off, or it is longer than the part; and as `roundness.evaluate` does.
    """
    heights = sorted({each.z_mm for each in sections})
    if len(heights) < LEAST_SECTIONS:
        raise ProfileError(few_sections(len(heights)))
    whole = [
        filtered_section(each, filter_upr, filter_kind) for each in sorted(sections, key=lambda each: each.z_mm)
    ]
    if filter_along_mm is not None:
        whole = _filtered_along(whole, filter_along_mm)
    angle = np.radians(np.concatenate([each.angle_deg for each in whole]))
    deviation = np.concatenate([each.deviation_um for each in whole])
    z = np.concatenate([np.full(each.angle_deg.size, each.z_mm) for each in whole])
    middle_mm = 0.5 * (heights[0] + heights[-1])
    weight = np.concatenate([angle_weights(each.angle_deg) for each in whole])
    weight /= weight.sum()
    points = Points(angle=angle, z_mm=z - middle_mm, deviation_um=deviation, weight=weight)
    cylinders = tuple(reference_cylinder(kind, points, radius_mm) for kind in CYLINDERS)
    cylt_um = next(each.cylt_um for each in cylinders if each.kind == MINIMUM_ZONE)
    turns = np.stack([section_at(each, TURN_DEG) for each in whole])
    least = min(each.angle_deg.size for each in whole)
    return CylinderResult(
        sections=tuple(map(section_form, whole)),
        filter_upr=filter_upr,
        cylinders=cylinders,
        causes=length_causes(floats([each.z_mm for each in whole]), turns, least, cylt_um),
        **_lines(whole),
        filter_along_mm=filter_along_mm,
        filter_kind=filter_kind,
        count=z.size,
    )


def evaluate_points(
    surface: SurfacePoints, *, radius_mm: float | None = None, filter_along_mm: float | None = None
) -> CylinderResult:
    """Return the cylindricity of points that are no sections; they are not filtered round.

    Along, each generatrix of a bird-cage is. Raises `ProfileError`: `trace.filter_along`, as `evaluate_cylinder`,
    and for points that have no lines along the part.
    """
    deviation, walls = surface.deviation_um.copy(), list[float]()
    if surface.strategy == BIRD_CAGE:
        line_of = generatrix_of(surface.angle_deg)
        for at in (np.flatnonzero(line_of == each) for each in np.unique(line_of)):
            at = at[np.argsort(surface.z_mm[at])]
            z = surface.z_mm[at]
            if filter_along_mm is not None:
                deviation[at] = gaussian_along(z, deviation[at], filter_along_mm)
            walls.append(float(np.ptp(deviation[at] - np.polyval(np.polyfit(z, deviation[at], 1), z))))
    elif filter_along_mm is not None:
        value = f"{filter_along_mm:g} mm"
        raise refusal_error("trace.no_lines_along", key="--filter-along", value=value)
    middle_mm = 0.5 * float(surface.z_mm.min() + surface.z_mm.max())
    points = Points(
        angle=np.radians(surface.angle_deg),
        z_mm=surface.z_mm - middle_mm,
        deviation_um=deviation,
        weight=np.full(deviation.size, 1.0 / deviation.size),
    )
    design = np.vstack([points.design(), points.z_mm / points.half_mm]).T
    return CylinderResult(
        sections=(),
        filter_upr=None,
        cylinders=tuple(reference_cylinder(kind, points, radius_mm) for kind in CYLINDERS),
        taper_um=2.0 * float(np.linalg.lstsq(design, deviation, rcond=None)[0][-1]),
        crown_um=None,
        axis_straightness_um=None,
        generatrix_straightness_um=max(walls, default=None),
        causes=(),
        strategy=surface.strategy,
        filter_along_mm=filter_along_mm,
        count=deviation.size,
    )


def coarse_points(surface: SurfacePoints, lobes: int) -> tuple[Problem, ...]:
    """Return why points that are no sections do not show a part with so many lobes; nothing where they do.

    Six generatrices may all be on nodes of three lobes. With seven to a lobe, and seven turns of a helix, CYLt of
    three lobes is at most about 5 % too small (computed). Scattered points have seven to a lobe in each third.
    """
    code, count, least = "trace.few_turns", 0, POINTS_PER_UNDULATION
    if surface.strategy == BIRD_CAGE:
        code, least = "trace.few_generatrices", POINTS_PER_UNDULATION * lobes
        count = np.unique(generatrix_of(surface.angle_deg)).size
    elif surface.strategy == HELIX:
        count = int(abs(np.diff(np.unwrap(surface.angle_deg, period=360.0)).sum()) / 360.0 + 0.5)
    else:
        code, least = "trace.few_scattered", POINTS_PER_UNDULATION * lobes
        count = int(np.histogram(surface.z_mm, bins=LEAST_SECTIONS)[0].min())
    return () if count >= least else (Problem(code=code, key=HEIGHT, value=str(count), limit=f">= {least}"),)


def gaussian_along(z_mm: Floats, deviation_um: Floats, cutoff_mm: float) -> Floats:
    """Return lines along the part through the low-pass: K rising heights, (K,) or (K, M) deviations.

    At each height a straight line is fitted with the Gaussian weights of the cut-off. Raises `ProfileError`
    `trace.filter_along`: fewer than `POINTS_PER_UNDULATION` heights for a wave of the cut-off, or a cut-off longer
    than the part.
    """
    length_mm, step_mm = float(np.ptp(z_mm)), float(np.diff(z_mm).max())
    if not POINTS_PER_UNDULATION * step_mm <= cutoff_mm * _EXACT <= length_mm * _EXACT**2:
        value = f"{cutoff_mm:g} mm (Z: {z_mm.size} x {step_mm:g} mm)"
        limit = f"{POINTS_PER_UNDULATION * step_mm:g} … {length_mm:g} mm"
        possible = POINTS_PER_UNDULATION * step_mm <= length_mm
        limit = limit if possible else f"<= {length_mm / POINTS_PER_UNDULATION:.3g} mm"
        code = "trace.filter_along" if possible else "trace.filter_along_heights"
        raise refusal_error(code, key="--filter-along", value=value, limit=limit)
    apart = z_mm[None, :] - z_mm[:, None]  # (K, K): from the height of the row
    weight = gaussian_weights(apart, cutoff_mm)
    zeroth, first, second = (np.sum(weight * apart**power, axis=1)[:, None] for power in range(3))
    return floats(weight * (second - first * apart) / (zeroth * second - first**2) @ deviation_um)


def _filtered_along(sections: Sequence[PartSection], cutoff_mm: float) -> list[PartSection]:
    """Return the sections at the angles of the first, filtered along the part."""
    angle_deg = sections[0].angle_deg
    stack = np.stack([section_at(each, angle_deg) for each in sections])
    found = gaussian_along(floats([each.z_mm for each in sections]), stack, cutoff_mm)
    return [
        replace(each, angle_deg=angle_deg, deviation_um=row) for each, row in zip(sections, found, strict=True)
    ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """M points: angle (rad), z from the middle (mm), deviation of the radius (um), and weights whose sum is 1."""

    angle: Floats
    z_mm: Floats
    deviation_um: Floats
    weight: Floats

    def design(self) -> Floats:
        """Return the rows 1, cos, sin, z cos, z sin, shape (5, M); z over half its range."""
        cosine, sine, half = np.cos(self.angle), np.sin(self.angle), self.half_mm
        return np.stack([np.ones_like(cosine), cosine, sine, self.z_mm / half * cosine, self.z_mm / half * sine])

    @property
    def half_mm(self) -> float:
        """Half of the evaluated length."""
        return float(np.abs(self.z_mm).max())

    def about(self, axis: Floats, radius_mm: float) -> Points:
        """Return the points with their distances from an axis: x, y, and slopes over the half length, um."""
        slope = axis[2:] / (1000.0 * self.half_mm)
        radius = radius_mm + self.deviation_um / 1000.0
        way = np.array([slope[0], slope[1], 1.0]) / math.sqrt(1.0 + float(slope @ slope))
        x = radius * np.cos(self.angle) - axis[0] / 1000.0
        y = radius * np.sin(self.angle) - axis[1] / 1000.0
        along = x * way[0] + y * way[1] + self.z_mm * way[2]
        x, y = x - along * way[0], y - along * way[1]
        across = np.hypot(np.hypot(x, y), self.z_mm - along * way[2])
        return replace(self, angle=np.arctan2(y, x), z_mm=along, deviation_um=1000.0 * (across - radius_mm))


def reference_cylinder(kind: str, points: Points, radius_mm: float | None) -> ReferenceCylinder:
    """Return a reference cylinder of points."""
    axis, half = np.zeros(4), points.half_mm
    seen = points
    for _ in range(_MOST_TURNS):
        moved = _moved(kind, seen)
        axis = axis + moved
        if radius_mm is None:
            seen = replace(seen, deviation_um=seen.deviation_um - moved @ seen.design()[1:])
            break
        seen = points.about(axis, radius_mm)
        if float(np.abs(moved).max()) < _STAYS_UM:
            break
    highest, lowest = float(seen.deviation_um.max()), float(seen.deviation_um.min())
    radius_um = {
        LEAST_SQUARES: float(seen.weight @ seen.deviation_um),
        MINIMUM_ZONE: 0.5 * (highest + lowest),
        MINIMUM_CIRCUMSCRIBED: highest,
        MAXIMUM_INSCRIBED: lowest,
    }[kind]
    return ReferenceCylinder(
        kind=kind,
        centre_x_um=float(axis[0]),
        centre_y_um=float(axis[1]),
        tilt_x_um_per_mm=float(axis[2]) / half,
        tilt_y_um_per_mm=float(axis[3]) / half,
        deviation_um=radius_um,
        cylt_um=highest - lowest,
        cylp_um=highest - radius_um,
        cylv_um=radius_um - lowest,
        cylq_um=math.sqrt(float(seen.weight @ (seen.deviation_um - radius_um) ** 2)),
    )


def _moved(kind: str, points: Points) -> Floats:
    """Return how far the axis of the cylinder is from the one that the points are seen from, (4,)."""
    design, deviation = points.design(), points.deviation_um
    root = np.sqrt(points.weight)
    squares = np.linalg.lstsq((design * root).T, deviation * root, rcond=None)[0]
    if kind == LEAST_SQUARES:
        return floats(squares[1:])
    left = deviation - squares @ design
    return floats(squares[1:] + _extreme(kind, design, left))


def _extreme(kind: str, design: Floats, left_um: Floats) -> Floats:
    """Return the shift of the axis from that of least squares, by the exchange of contacts."""
    span_um = float(np.ptp(left_um))
    if span_um == 0.0:
        return np.zeros(4)
    if kind == MINIMUM_ZONE:
        return floats(span_um * contacts(zone_columns(design), left_um / span_um).prices[-4:])
    sign = -1.0 if kind == MAXIMUM_INSCRIBED else 1.0
    return floats(sign * span_um * contacts(design, sign * left_um / span_um).prices[-4:])


def zone_columns(design: Floats) -> Floats:
    """Return the columns of a minimum zone, (6, 2 M), of the design (5, M) of its points."""
    return np.hstack([np.insert(design, 1, 0.0, axis=0), np.insert(design * _OTHER_SIDE, 0, 0.0, axis=0)])


def contacts(
    columns: Floats, gains: Floats, start: NDArray[np.intp] | None = None, outside: float = _OUTSIDE
) -> Optimum:
    """Return the contacts of points, deviations (M,) of a span near 1, with a zone, or a cylinder: (5, M) columns.

    `start` is the basis of other deviations at the same points. The width of a zone is the first two prices.
    """
    rows = columns.shape[0]
    every = np.hstack([columns, np.eye(rows)])
    gain = np.concatenate([*(gains, -gains)[: rows - 4], np.full(rows, -_UNUSED)])
    # A cylinder that rests on few points: without the tiny forces every exchange at the start would bring nothing.
    rhs = _TINY * np.arange(1.0, rows + 1.0)
    rhs[: rows - 4] = 1.0
    basis = np.arange(gain.size - rows, gain.size, dtype=np.intp) if start is None else start
    return exchange_basis(
        every, gain, rhs, basis, tolerance=outside, excess_of=lambda prices: floats(gain - prices @ every)
    )


def filtered_section(section: PartSection, filter_upr: float | None, filter_kind: FilterKind) -> PartSection:
    """Return the section through the filter, with the mean and the centre that it has."""
    angle, profile = profile_of(section.angle_deg, section.deviation_um, filter_upr, filter_kind=filter_kind)
    mean, x, y = _centre(section)
    theta = np.radians(angle)
    return PartSection(
        z_mm=section.z_mm, angle_deg=angle, deviation_um=profile + mean + x * np.cos(theta) + y * np.sin(theta)
    )


def section_form(section: PartSection) -> SectionForm:
    """Return roundness (LSCI) and mean deviation of a filtered section."""
    mean_um, x, y = _centre(section)
    theta = np.radians(section.angle_deg)
    profile = section.deviation_um - mean_um - x * np.cos(theta) - y * np.sin(theta)
    return SectionForm(z_mm=section.z_mm, ront_um=float(np.ptp(profile)), mean_um=mean_um)


def _centre(section: PartSection) -> tuple[float, float, float]:
    """Return mean radius and centre of the least squares circle, um."""
    circle = limacon_circle("LSC", section.angle_deg, section.deviation_um)
    return circle.deviation_um, circle.centre_x_um, circle.centre_y_um


def _lines(sections: Sequence[PartSection]) -> dict[str, Any]:
    """Return taper, crown and straightnesses of the sections."""
    z = floats([each.z_mm for each in sections])
    mean, x, y = (floats(each) for each in zip(*map(_centre, sections), strict=True))
    line = np.stack([np.ones_like(z), z - z.mean()], axis=1)

    def left(values: Floats) -> Floats:
        return floats(values - line @ np.linalg.lstsq(line, values, rcond=None)[0])

    walls = np.stack([section_at(each, TURN_DEG) for each in sections])
    return {
        "taper_um": float(np.polyfit(z, mean, 1)[0] * np.ptp(z)),
        "crown_um": float(np.ptp(left(mean))),
        "axis_straightness_um": 2.0 * float(np.hypot(left(x), left(y)).max()),
        "generatrix_straightness_um": float(np.ptp(left(walls), axis=0).max()),
    }


def section_at(section: PartSection, angle_deg: Floats) -> Floats:
    """Return the deviations of a section at these angles, interpolated."""
    order = np.argsort(np.mod(section.angle_deg, 360.0), kind="stable")
    turn = np.mod(section.angle_deg, 360.0)[order]
    return floats(np.interp(angle_deg, turn, section.deviation_um[order], period=360.0))
