"""Reference cylinders: against a solver of linear programmes, exact geometry, and by arithmetic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from profiles.arrays import Floats, floats
from profiles.metrology.cylindricity import (
    CYLINDERS,
    LEAST_SQUARES,
    MINIMUM_CIRCUMSCRIBED,
    MINIMUM_ZONE,
    PartSection,
    Points,
    evaluate_cylinder,
    evaluate_points,
    gaussian_along,
    reference_cylinder,
)
from profiles.problem import ProfileError
from profiles.trace_files.sections import SurfacePoints

TURN_DEG = np.arange(0.0, 360.0, 1.0)
HEIGHTS_MM = (2.0, 4.0, 6.0, 8.0, 10.0)


def part(deviation_um: dict[float, Floats]) -> list[PartSection]:
    return [PartSection(z_mm=z, angle_deg=TURN_DEG, deviation_um=um) for z, um in deviation_um.items()]


def solved(kind: str, design: Floats, deviation: Floats) -> float:
    """The same programme by HiGHS: the width of the zone, or the radius of the one cylinder."""
    around, size = design[1:].T, deviation.size
    if kind == MINIMUM_ZONE:
        lower = np.c_[np.ones(size), np.zeros(size), around]
        upper = np.c_[np.zeros(size), -np.ones(size), -around]
        found = linprog(
            [-1, 1, 0, 0, 0, 0],
            A_ub=np.vstack([lower, upper]),
            b_ub=np.r_[deviation, -deviation],
            bounds=[(None, None)] * 6,
        )
        return float(found.fun)
    sign = -1.0 if kind == MINIMUM_CIRCUMSCRIBED else 1.0
    found = linprog([-sign, 0, 0, 0, 0], A_ub=sign * design.T, b_ub=sign * deviation, bounds=[(None, None)] * 5)
    return float(-sign * found.fun)


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", range(10))
def test_zone_and_bounding_cylinders_are_those_of_a_general_solver(seed: int) -> None:
    """50 parts a seed of 3 to 6 sections, lobed, off the axis and tilted: to 1e-9 um."""
    random = np.random.default_rng(seed)
    for _ in range(50):
        sections, count = int(random.integers(3, 7)), int(random.integers(12, 120))
        z = np.repeat(np.sort(random.uniform(-20, 20, sections)), count)
        angle = np.tile(2 * np.pi * np.arange(count) / count, sections)
        lobe = random.uniform(0, 10) * np.cos(3 * angle) * (1 + z / 40)
        axis = (random.normal(0, 30) + z * random.normal()) * np.cos(angle) + z * random.normal() * np.sin(angle)
        deviation = lobe + axis + random.normal(0, 1, angle.size)
        points = Points(angle=angle, z_mm=z, deviation_um=deviation, weight=np.full(angle.size, 1 / angle.size))
        for kind in CYLINDERS[1:]:
            found = reference_cylinder(kind, points, None)
            value = found.cylt_um if kind == MINIMUM_ZONE else found.deviation_um
            assert value == pytest.approx(solved(kind, points.design(), deviation), abs=1e-9)


def test_a_round_part_off_the_axis_and_tilted_has_no_error() -> None:
    """Points of an exact cylinder of 26 mm about a line 80 um off and tilted by 3 um/mm."""
    sections, way = [], np.array([3e-3, 2e-3, 1.0]) / np.linalg.norm([3e-3, 2e-3, 1.0])
    for z in HEIGHTS_MM:
        radius, theta = np.full(TURN_DEG.size, 26.0), np.radians(TURN_DEG)
        for _ in range(30):
            place = np.stack(
                [radius * np.cos(theta) - 0.08, radius * np.sin(theta) + 0.04, np.full(theta.size, z)]
            )
            across = np.linalg.norm(place - np.outer(way, way @ place), axis=0)
            radius = radius + 26.0 - across
        sections.append(PartSection(z_mm=z, angle_deg=TURN_DEG, deviation_um=1000 * (radius - 26.0)))
    found = evaluate_cylinder(sections, radius_mm=26.0, filter_upr=None)
    for kind in CYLINDERS:
        assert found.cylinder(kind).cylt_um == pytest.approx(0.0, abs=1e-6)
        assert found.cylinder(kind).tilt_x_um_per_mm == pytest.approx(3.0, abs=1e-6)
    assert evaluate_cylinder(sections, filter_upr=None).cylinder(MINIMUM_ZONE).cylt_um > 0.1, "the linear model"


def test_a_lobe_that_grows_along_the_part_is_in_every_parameter() -> None:
    """3 cos 3a at the ends of a length, 1 cos 3a in its middle: least squares has the cylinder of radius 0."""
    lobe = np.cos(3 * np.radians(TURN_DEG))
    found = evaluate_cylinder(part({0.0: 3 * lobe, 5.0: lobe, 10.0: 3 * lobe}), filter_upr=None)
    squares = found.cylinder(LEAST_SQUARES)
    assert (squares.cylt_um, squares.cylp_um, squares.cylv_um) == pytest.approx((6.0, 3.0, 3.0))
    assert squares.cylq_um == pytest.approx(np.sqrt((9 + 1 + 9) / 3 / 2))
    assert found.cylinder(MINIMUM_ZONE).cylt_um == pytest.approx(6.0)
    assert (found.taper_um, found.crown_um) == pytest.approx((0.0, 0.0), abs=1e-9)
    # Heights of a wall (3, 1, 3) leave (2/3, -4/3, 2/3) about their line.
    assert found.generatrix_straightness_um == pytest.approx(2.0)


def test_taper_crown_and_a_bent_axis_are_told_apart() -> None:
    theta = np.radians(TURN_DEG)
    taper = evaluate_cylinder(part({z: np.full(360, 0.5 * z) for z in HEIGHTS_MM}))
    assert (taper.taper_um, taper.crown_um) == pytest.approx((4.0, 0.0), abs=1e-9)
    assert taper.cylinder(MINIMUM_ZONE).cylt_um == pytest.approx(4.0)
    crown = evaluate_cylinder(part({z: np.full(360, 3.0 if z == 6.0 else 0.0) for z in HEIGHTS_MM}))
    assert (crown.taper_um, crown.crown_um) == pytest.approx((0.0, 3.0), abs=1e-9)
    bent = evaluate_cylinder(part({z: (2.0 if z == 6.0 else 0.0) * np.cos(theta) for z in HEIGHTS_MM}))
    # Of centres (0, 0, 2, 0, 0) the line of least squares is at 0.4; 1.6 is the furthest.
    assert bent.axis_straightness_um == pytest.approx(3.2)
    assert bent.crown_um == pytest.approx(0.0, abs=1e-9)
    assert bent.cylinder(MINIMUM_ZONE).cylt_um == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("points", [720, 3600])
def test_a_profile_that_is_the_same_in_each_section_touches_at_many_points_alike(points: int) -> None:
    """An oval of 2 um as a gauge writes it, to 0.01 um: the zone is that of one section."""
    angle_deg = np.arange(points) * 360.0 / points
    oval_um = floats(np.round(np.cos(2.0 * np.radians(angle_deg)), 2))
    sections = [
        PartSection(z_mm=z_mm, angle_deg=angle_deg, deviation_um=oval_um) for z_mm in (-3.2, -1.6, 0.0, 1.6, 3.2)
    ]
    found = evaluate_cylinder(sections, radius_mm=26.0, filter_upr=None)
    assert found.cylinder("MZCY").cylt_um == pytest.approx(2.0, abs=1e-4)
    assert found.cylinder("MCCY").cylt_um == pytest.approx(2.0, abs=0.05)


def test_two_heights_are_no_cylinder() -> None:
    with pytest.raises(ProfileError) as caught:
        evaluate_cylinder(part({0.0: np.zeros(360), 5.0: np.zeros(360)}))
    assert [each.code for each in caught.value.problems] == ["trace.few_sections"]


ALONG_MM = np.arange(0.0, 40.0, 0.1)


@pytest.mark.parametrize(("waves_mm", "passed"), [(4.0, 0.5), (8.0, 0.5**0.25), (2.0, 0.5**4)])
def test_along_the_part_half_of_a_wave_of_the_cut_off_passes(waves_mm: float, passed: float) -> None:
    """The transmission of ISO 16610-21, exp(-pi (alpha cut-off / wave)^2); the ends are left out."""
    found = gaussian_along(ALONG_MM, np.sin(2 * np.pi * ALONG_MM / waves_mm), 4.0)
    inner = slice(80, -80)
    assert np.ptp(found[inner]) == pytest.approx(2.0 * passed, rel=0.01)


def test_along_the_part_a_taper_stays_to_its_ends() -> None:
    taper = np.stack([0.7 * ALONG_MM - 3.0, 5.0 - 0.2 * ALONG_MM], axis=1)
    assert gaussian_along(ALONG_MM, taper, 4.0) == pytest.approx(taper, abs=1e-9)


@pytest.mark.parametrize(
    ("z_mm", "cutoff_mm", "code", "limit"),
    [
        (np.arange(0.0, 8.01, 0.2), 1.0, "trace.filter_along", "1.4 … 8 mm"),
        (np.arange(0.0, 8.01, 0.2), 9.0, "trace.filter_along", "1.4 … 8 mm"),
        (np.arange(0.0, 8.01, 2.0), 8.0, "trace.filter_along_heights", "<= 1.14 mm"),
    ],
)
def test_a_cut_off_that_the_heights_do_not_show_is_refused(
    z_mm: Floats, cutoff_mm: float, code: str, limit: str
) -> None:
    sections = part({float(z): floats(np.cos(np.radians(TURN_DEG * 2))) for z in z_mm})
    with pytest.raises(ProfileError) as caught:
        evaluate_cylinder(sections, filter_along_mm=cutoff_mm)
    (problem,) = caught.value.problems
    assert (problem.code, problem.limit) == (code, limit)


def surface(strategy: str, angle_deg: Floats, z_mm: Floats) -> SurfacePoints:
    """Three lobes of 4 um p-p on a cone of 0.5 um/mm, whose axis is off and leans."""
    angle = np.radians(angle_deg)
    axis = (7.0 - 0.3 * z_mm) * np.cos(angle) + 0.2 * z_mm * np.sin(angle)
    deviation_um = 2.0 * np.cos(3 * angle) + 0.5 * z_mm + axis
    return SurfacePoints(strategy=strategy, angle_deg=angle_deg, z_mm=z_mm, deviation_um=deviation_um, meta={})


def test_a_helix_has_the_form_of_the_part_and_no_sections() -> None:
    angle_deg = np.arange(0.0, 360.0 * 40, 3.0)
    found = evaluate_points(surface("helix", angle_deg % 360.0, 8.0 * angle_deg / angle_deg[-1]))
    assert (found.strategy, found.sections, found.count) == ("helix", (), angle_deg.size)
    assert found.taper_um == pytest.approx(4.0, rel=0.01)
    assert found.cylinder(MINIMUM_ZONE).cylt_um == pytest.approx(8.0, rel=0.02), "both lobe and cone, 4 um each"
    assert (found.filter_upr, found.filter_along_mm) == (None, None)
    with pytest.raises(ProfileError) as caught:
        evaluate_points(surface("helix", angle_deg % 360.0, angle_deg / 360.0), filter_along_mm=1.0)
    assert [each.code for each in caught.value.problems] == ["trace.no_lines_along"]


def test_a_bird_cage_has_generatrices_which_the_filter_along_smooths() -> None:
    z, angle = (each.ravel() for each in np.meshgrid(np.arange(0.0, 8.01, 0.1), np.arange(0.0, 360.0, 30.0)))
    cage = surface("bird-cage", angle, z)
    assert evaluate_points(cage).generatrix_straightness_um == pytest.approx(0.0, abs=1e-9)
    waved = replace(cage, deviation_um=cage.deviation_um + 0.5 * np.sin(2 * np.pi * z / 0.6))
    rough, smooth = evaluate_points(waved), evaluate_points(waved, filter_along_mm=2.0)
    assert rough.generatrix_straightness_um == pytest.approx(0.866, rel=0.1), "six points a wave"
    assert smooth.generatrix_straightness_um is not None
    assert smooth.generatrix_straightness_um < 0.433, "the middle keeps nearly nothing of it, the ends some"
    assert smooth.filter_along_mm == 2.0
