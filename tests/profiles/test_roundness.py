"""Roundness, also of uneven traces."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats
from profiles.metrology.circles import limacon_circle
from profiles.metrology.geometric import polar
from profiles.metrology.points import angle_weights, equally_spaced, gaussian_filter, gaussian_transmission
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult, centred_profile, evaluate, profile_of

ANGLE = np.arange(3600) / 10
THETA = np.radians(ANGLE)
LOBES = 27.5 * np.sin(3 * THETA)
EIGHT = [0.0, 3.0, 1.0, -2.0, 4.0, -1.0, 2.0, -3.0]


def waves(angle_deg: NDArray[np.float64], *parts: tuple[int, float, float]) -> NDArray[np.float64]:
    total = np.zeros_like(angle_deg)
    for n, amplitude, phase_deg in parts:
        total += amplitude * np.cos(n * np.radians(angle_deg - phase_deg))
    return total


def refusal(angle_deg: ArrayLike, deviation_um: ArrayLike, filter_upr: float | None = None) -> str:
    with pytest.raises(ProfileError) as caught:
        evaluate(angle_deg, deviation_um, filter_upr)
    return caught.value.problems[0].code


def test_three_lobes_of_55_um_also_off_centre() -> None:
    result = evaluate(ANGLE, LOBES, None, state="free")
    assert result.ront_um == pytest.approx(55, abs=1e-9)
    assert (result.ronp_um, result.ronv_um) == pytest.approx((27.5, 27.5), abs=1e-9)
    assert result.ronq_um == pytest.approx(19.445436, abs=1e-6)
    assert result.eccentricity_um == pytest.approx(0, abs=1e-9)
    assert (result.reference_circle, result.filter_upr, result.state) == ("LSC", None, "free")
    assert result.points == 3600
    lobe = result.harmonics[1]
    assert (lobe.n, lobe.amplitude_um, lobe.phase_deg) == pytest.approx((3, 27.5, 30), abs=1e-9)
    assert [harmonic.n for harmonic in result.harmonics] == list(range(2, 16))
    result = evaluate(ANGLE, LOBES + 12 * np.cos(THETA) - 7 * np.sin(THETA), None)
    assert (result.centre_x_um, result.centre_y_um) == pytest.approx((12, -7), abs=1e-9)
    assert result.ront_um == pytest.approx(55, abs=1e-9)


def test_eight_points() -> None:
    result = evaluate(np.arange(8) * 45, EIGHT, None)
    assert result.ront_um == pytest.approx(6.310660, abs=1e-6)
    assert (result.centre_x_um, result.centre_y_um) == pytest.approx((-0.469670, 0.633883), abs=1e-6)
    assert result.mean_deviation_um == pytest.approx(0.5)
    assert [harmonic.n for harmonic in result.harmonics] == [2, 3]


# ISO 16610-21, transmission at n for cut-offs of 15, 50 and 150 UPR.
FILTER_TABLE = {
    15: {1: 0.99692, 3: 0.97265, 6: 0.89503, 9: 0.77916, 15: 0.5, 30: 0.0625, 50: 0.00045, 100: 0},
    50: {1: 0.99972, 3: 0.99751, 6: 0.99007, 9: 0.97779, 15: 0.93952, 30: 0.77916, 50: 0.5, 150: 0.00195},
    150: {1: 0.99997, 3: 0.99972, 6: 0.99889, 9: 0.99751, 50: 0.92587, 100: 0.73487, 150: 0.5},
}


@pytest.mark.parametrize("cutoff", FILTER_TABLE)
def test_the_filter(cutoff: int) -> None:
    for n, transmission in FILTER_TABLE[cutoff].items():
        assert float(gaussian_transmission(n, cutoff)) == pytest.approx(transmission, abs=5.1e-6)
        passed = gaussian_filter(np.cos(n * THETA), cutoff)
        np.testing.assert_allclose(passed, transmission * np.cos(n * THETA), atol=1e-5)


def test_a_filter_takes_its_share_and_moves_no_centre() -> None:
    assert evaluate(ANGLE, LOBES, 15).ront_um == pytest.approx(53.50, abs=0.005)
    result = evaluate(ANGLE, LOBES + 12 * np.cos(THETA), 15)
    assert result.centre_x_um == pytest.approx(12, abs=1e-9)


def test_angles_may_be_unequal_rounded_or_in_any_order() -> None:
    order = np.random.default_rng(1).permutation(3600)
    expected = centred_profile(ANGLE, LOBES + 3 * np.cos(40 * THETA))
    shuffled = centred_profile(ANGLE[order], (LOBES + 3 * np.cos(40 * THETA))[order])
    np.testing.assert_allclose(shuffled, expected[order], atol=1e-9)
    angle = np.sort(np.random.default_rng(2).uniform(0, 360, 400))
    deviation = 5 + waves(angle, (1, 40.0, 77.0), (3, 27.5, 10.0), (2, 4.0, 100.0))
    result = evaluate(angle, deviation, None)
    assert result.amplitude_um(3) == pytest.approx(27.5, abs=1e-6)
    assert result.amplitude_um(2) == pytest.approx(4, abs=1e-6)
    assert result.harmonics[1].phase_deg == pytest.approx(10, abs=1e-6)
    filtered = evaluate(angle, deviation, 15)
    assert filtered.amplitude_um(3) == pytest.approx(27.5 * FILTER_TABLE[15][3], abs=2e-3)
    assert filtered.eccentricity_um == pytest.approx(40, abs=1e-3)
    assert equally_spaced(np.round(np.arange(1024) * 360 / 1024, 3))
    assert equally_spaced([350, 80, 170, 260])
    assert not equally_spaced([0, 90, 180, 271])


def test_few_points_a_gap_of_60_deg_and_a_crowd_are_still_a_part() -> None:
    angle = np.arange(136) * 360 / 136
    assert [w.limit for w in evaluate(angle, 0 * angle, 50).warnings] == [">= 350"]
    assert evaluate(ANGLE, LOBES, 50).warnings == ()
    assert evaluate(angle, 0 * angle, None).warnings == ()
    measured = np.concatenate(([0.0], np.arange(60, 360)))
    assert evaluate(measured, 12 * np.cos(np.radians(measured)), None).eccentricity_um == pytest.approx(12)
    assert refusal(np.concatenate(([0.0], np.arange(60.5, 360))), np.zeros(301)) == "trace.narrow_angles"
    angle = np.concatenate((np.linspace(0, 1, 20_000), np.arange(60, 360, 60)))
    result = evaluate(angle, 5 + 12 * np.cos(np.radians(angle)), None)
    assert (result.centre_x_um, result.mean_deviation_um) == pytest.approx((12, 5), abs=1e-6)


def off_centre(eccentricity_um: float, angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deviations, from an axis beside the part, of 27.5 sin 3t on a radius of 26 mm: by rays, with no model."""
    distance, e = np.full_like(angle_deg, 26_000.0), eccentricity_um
    theta = np.radians(angle_deg)
    for _ in range(30):  # where the ray from the axis meets the part
        own = np.arctan2(distance * np.sin(theta), distance * np.cos(theta) - e)
        radius = 26_000.0 + 27.5 * np.sin(3 * own)
        distance = e * np.cos(theta) + np.sqrt(radius**2 - (e * np.sin(theta)) ** 2)
    return np.asarray(distance - 26_000.0)


def test_a_part_far_off_centre_is_taken_about_its_own() -> None:
    """A limacon of 500 um on 26 mm looks 4.8 um oval: 58.7 um instead of 55."""
    deviation = off_centre(500.0, ANGLE)
    assert evaluate(ANGLE, deviation, None).ront_um == pytest.approx(58.66, abs=0.05)
    result = evaluate(ANGLE, deviation, None, radius_mm=26.0)
    assert result.recentred
    # The rays meet one side of the part more densely: least squares minds, by 0.01 um, and the others do not.
    assert result.ront_um == pytest.approx(55, abs=0.02)
    assert (result.centre_x_um, result.centre_y_um) == pytest.approx((500, 0), abs=0.02)
    assert result.mean_deviation_um == pytest.approx(0, abs=0.02)
    assert [circle.ront_um for circle in result.circles[1:]] == pytest.approx([55] * 3, abs=2e-3)
    lobe = result.harmonics[1]
    assert (lobe.amplitude_um, lobe.phase_deg) == pytest.approx((27.5, 30), abs=2e-3)
    assert result.amplitude_um(2) < 1e-3
    filtered = evaluate(ANGLE, deviation, 15, radius_mm=26.0)
    assert filtered.ront_um == pytest.approx(53.496, abs=0.02)


@pytest.mark.parametrize(
    ("eccentricity_um", "told"),
    [(500.0, ["500 um", "5 um (R = 25 mm)", "2.5e+03 mm"]), (100.0, ["100 um", "0.2 um (R = 25 mm)", "100 mm"])],
)
def test_a_circle_off_the_axis_without_a_radius_is_told(eccentricity_um: float, told: list[str]) -> None:
    """By rays a circle of 26 mm that is 500 um off looks 4.81 um oval: below 2.5 m that is above 0.05 um."""
    theta, e = THETA, eccentricity_um
    circle = e * np.cos(theta) + np.sqrt(26_000.0**2 - (e * np.sin(theta)) ** 2) - 26_000.0
    result = evaluate(ANGLE, circle, None)
    assert result.ront_um == pytest.approx(e**2 / 52_000, rel=0.01)
    assert [[p.value, p.key, p.limit] for p in result.warnings if p.code == "trace.off_axis"] == [told]
    assert evaluate(ANGLE, circle, None, radius_mm=26.0).warnings == ()
    assert evaluate(ANGLE, circle, None, radius_mm=26.0).ront_um == pytest.approx(0.0, abs=0.05)
    assert evaluate(ANGLE, circle * 0.04, None).warnings == (), "20 um are centred well enough for any part"


def test_recentring_step_by_step() -> None:
    """Points at equal angles about the part: a limacon makes 55 um 58.687, a step about its centre mends it.

    As many as by rays at equal angles about the axis: points weigh by their angle.
    """
    radius = 26_000 + LOBES
    x, y = 500 + radius * np.cos(THETA), radius * np.sin(THETA)
    centre, met = (0.0, 0.0), []
    for _ in range(3):
        angle, distance = polar(x, y, centre)
        step = limacon_circle("LSC", angle, distance)
        met.append(step.ront_um)
        centre = (centre[0] + step.centre_x_um, centre[1] + step.centre_y_um)
    rays = limacon_circle("LSC", ANGLE, off_centre(500.0, ANGLE)).ront_um
    assert met[0] == pytest.approx(rays, abs=5e-4) == pytest.approx(58.687, abs=5e-4)
    assert met[1:] == pytest.approx([55, 55], abs=1e-6)
    angle, distance = polar(x, y, (0.0, 0.0))
    result = evaluate(angle, distance - 26_000, None, radius_mm=26.0)
    assert result.ront_um == pytest.approx(55, abs=1e-6)
    assert [circle.ront_um for circle in result.circles] == pytest.approx([55] * 4, abs=1e-6)


@pytest.mark.parametrize(("eccentricity_um", "recentred"), [(50, False), (52, True)])
def test_the_limit_of_the_limacon_is_an_ovality_of_50_nm(eccentricity_um: float, recentred: bool) -> None:
    result = evaluate(ANGLE, off_centre(eccentricity_um, ANGLE), None, radius_mm=26.0)
    assert result.recentred is recentred
    assert result.ront_um == pytest.approx(55, abs=0.05)


def test_a_part_too_far_off_is_refused_and_problems_say_what_was_met() -> None:
    with pytest.raises(ProfileError) as caught:
        evaluate(ANGLE, off_centre(2700.0, ANGLE), None, radius_mm=26.0)
    (problem,) = caught.value.problems
    assert (problem.code, problem.limit) == ("trace.eccentric", "<= 2600 um")
    for angle, deviation in (
        ([0.0, 60, 120, 180, 240, 301], [0.0] * 6),
        ([0.0, 60, 120, 180], [0.0, math.nan, 0, 0]),
    ):
        with pytest.raises(ProfileError) as caught:
            evaluate(angle, deviation, 50)
        assert all(problem.key and problem.value for problem in caught.value.problems)
    assert math.copysign(1, evaluate(ANGLE, np.zeros(3600), None).ronv_um) == 1


def test_a_band_passes_what_lies_between() -> None:
    profile = LOBES + waves(ANGLE, (30, 4.0, 0.0), (300, 2.0, 0.0))
    result = evaluate(ANGLE, profile, 150, above_upr=15)
    assert (result.filter_upr, result.above_upr) == (150, 15)
    assert result.amplitude_um(3) == pytest.approx(27.5 * (0.99972 - 0.97265), abs=1e-3)
    assert result.ront_um == pytest.approx(2 * 4.0 * (0.97265 - 0.0625) + 2 * 27.5 * 0.02707, abs=0.1)
    for band in ((15.0, 15.0), (15.0, 50.0), (None, 15.0), (15.0, 0.0)):
        with pytest.raises(ProfileError) as caught:
            evaluate(ANGLE, profile, band[0], above_upr=band[1])
        assert caught.value.problems[0].code == "value.out_of_range"


@pytest.mark.parametrize("filter_upr", [None, 50.0])
def test_chips_and_scratches_are_left_out(filter_upr: float | None) -> None:
    angle, lobes = ANGLE[::5], LOBES[::5]
    noise = np.random.default_rng(3).normal(0, 0.3, 720)
    clean = evaluate(angle, lobes + noise, filter_upr)
    dirty = lobes + noise
    dirty[[40, 41, 42, 300, 580]] += [25, 40, 30, -20, 60]
    robust = evaluate(angle, dirty, filter_upr, robust=True)
    assert robust.left_out == 5
    assert evaluate(angle, dirty, filter_upr).ront_um > clean.ront_um + 5
    assert robust.ront_um == pytest.approx(clean.ront_um, abs=0.3)
    assert robust.amplitude_um(3) == pytest.approx(clean.amplitude_um(3), abs=0.02)
    assert evaluate(angle, lobes + noise, filter_upr, robust=True).left_out == 0


def test_refusals_and_waves_that_are_no_dirt() -> None:
    assert evaluate(ANGLE, LOBES + 5 * np.cos(40 * THETA), None, robust=True).left_out == 0
    with pytest.raises(ProfileError) as caught:
        evaluate(ANGLE, LOBES + np.where(np.arange(3600) % 8 == 0, 20.0, 0.0), None, robust=True)
    assert caught.value.problems[0].code == "trace.outliers"
    assert refusal([0, 90, 180], [0, 0, 0]) == "trace.few_points"
    assert refusal([0, 90, 180, 270], [0, 0, 0]) == "trace.columns"
    assert refusal([0, 90, 180, 270], [0, 0, 0, math.nan]) == "trace.not_finite"
    assert refusal([0, 90, 180, 270], [0, 0, 0, 0]) == "trace.narrow_angles"
    assert refusal([0, 0.1, 0.2, 0.3, 0.4], [0, 1, 0, 1, 0]) == "trace.narrow_angles"
    assert refusal([10] * 5, [0, 1, 0, 1, 0]) == "trace.narrow_angles"
    for cutoff in (0, -1, math.nan, math.inf):
        assert refusal(ANGLE, LOBES, filter_upr=cutoff) == "value.out_of_range"


@pytest.mark.parametrize("filter_upr", [None, 50.0])
def test_half_a_turn_is_no_part(filter_upr: float | None) -> None:
    with pytest.raises(ProfileError) as caught:
        evaluate(np.arange(180), LOBES[:1800:10], filter_upr)
    (problem,) = caught.value.problems
    assert (problem.code, problem.value, problem.limit) == ("trace.narrow_angles", "181 deg", "<= 60 deg")


DEVIATIONS = st.lists(st.floats(-100, 100), min_size=16, max_size=64)


@given(DEVIATIONS, st.floats(-50, 50), st.floats(-50, 50), st.floats(-500, 500), st.floats(0, 360))
def test_centre_offset_and_start_angle_do_not_matter(
    deviations: list[float], x: float, y: float, mean: float, start: float
) -> None:
    deviation = np.array(deviations)
    angle = np.arange(deviation.size) * 360 / deviation.size
    shifted = deviation + mean + x * np.cos(np.radians(angle)) + y * np.sin(np.radians(angle))
    for cutoff in (None, 15.0):
        plain, moved = (evaluate(angle, d, cutoff) for d in (deviation, shifted))
        turned = evaluate(angle + start, deviation, cutoff)
        for other in (moved, turned):
            assert other.ront_um == pytest.approx(plain.ront_um, abs=1e-9)
            assert other.ronq_um == pytest.approx(plain.ronq_um, abs=1e-9)
        assert moved.centre_x_um - plain.centre_x_um == pytest.approx(x, abs=1e-9)


@given(DEVIATIONS, st.floats(0.01, 100))
def test_scaling(deviations: list[float], factor: float) -> None:
    angle = np.arange(len(deviations)) * 360 / len(deviations)
    small, large = (evaluate(angle, np.array(deviations) * k, None).ront_um for k in (1, factor))
    assert large == pytest.approx(factor * small, rel=1e-9, abs=1e-9)


@given(st.integers(2, 15), st.floats(0.01, 500), st.floats(-720, 720))
def test_a_harmonic_is_found_with_its_first_crest(n: int, amplitude: float, crest_deg: float) -> None:
    result = evaluate(ANGLE[::10], waves(ANGLE[::10], (n, amplitude, crest_deg)), None)
    found = result.harmonics[n - 2]
    assert found.n == n and 0 <= found.phase_deg < 360 / n
    assert found.amplitude_um == pytest.approx(amplitude, rel=1e-9)
    np.testing.assert_allclose(math.cos(n * math.radians(found.phase_deg - crest_deg)), 1, atol=1e-9)
    assert all(other.amplitude_um < 1e-9 * amplitude for other in result.harmonics if other.n != n)


# Traces with unequal steps, gaps and features, against parts whose roundness is known.
#
# The part is 10 cos 3t + 3 cos 2(t - 151.35 deg): its RONt is that of a quadrature with 360 000 points.

FULL = np.arange(3600) / 10
QUADRANT = np.concatenate((np.arange(0, 90, 0.02), np.arange(90, 360, 0.6)))


def part(angle_deg: Floats) -> Floats:
    theta = np.radians(angle_deg)
    lobes = 10 * np.cos(3 * theta) + 3 * np.cos(2 * (theta - np.radians(151.35)))
    return np.asarray(lobes + 4 + 6 * np.cos(theta) - 2 * np.sin(theta))


def truth_um() -> float:
    theta = np.arange(360_000) * (2 * np.pi / 360_000)
    return float(np.ptp(10 * np.cos(3 * theta) + 3 * np.cos(2 * (theta - np.radians(151.35)))))


def warned(result: RoundnessResult, code: str = "trace.interpolated") -> list[Problem]:
    return [problem for problem in result.warnings if problem.code == code]


def refused(angle_deg: Floats, deviation_um: Floats, filter_upr: float | None = 50.0) -> Problem:
    with pytest.raises(ProfileError) as caught:
        evaluate(angle_deg, deviation_um, filter_upr)
    (problem,) = caught.value.problems
    return problem


def test_the_part_is_24_7_um() -> None:
    assert truth_um() == pytest.approx(24.749, abs=1e-3)


ROUNDED = np.unique(np.round(np.arange(1024) * 360 / 1024, 1))
LOST = np.delete(FULL, [10, 500, 501, 502, 1800])
DRAWN = np.sort(np.random.default_rng(5).uniform(0, 360, 2000))


@pytest.mark.parametrize("filter_upr", [None, 50.0])
@pytest.mark.parametrize("angle", [QUADRANT, ROUNDED, LOST, DRAWN, FULL[FULL > 45]])
def test_how_the_angles_are_spaced_does_not_change_the_part(angle: Floats, filter_upr: float | None) -> None:
    """RONq by Parseval: sqrt((10^2 + 3^2) / 2) = 7.382; at 50 UPR the lobes pass by 0.99751 and 0.99889."""
    result = evaluate(angle, part(angle), filter_upr)
    passed = 1.0 if filter_upr is None else 0.9978
    assert result.ront_um == pytest.approx(truth_um() * passed, abs=0.005)
    assert result.ronq_um == pytest.approx(7.3824 * passed, abs=0.003)
    assert (result.centre_x_um, result.centre_y_um) == pytest.approx((6, -2), abs=0.003)
    assert result.mean_deviation_um == pytest.approx(4, abs=0.003)
    assert result.points == angle.size


@pytest.mark.parametrize("radius_mm", [None, 26.0])
def test_a_densely_scanned_quadrant_does_not_draw_the_circle_to_it(radius_mm: float | None) -> None:
    """The other circles too: those of the part in equal steps; in the plane, with its radius, as well."""
    dense = evaluate(QUADRANT, part(QUADRANT), None, radius_mm=radius_mm)
    equal = evaluate(FULL, part(FULL), None, radius_mm=radius_mm)
    for found, expected in zip(dense.circles, equal.circles, strict=True):
        assert found.ront_um == pytest.approx(expected.ront_um, abs=0.005)
        assert found.ronq_um == pytest.approx(expected.ronq_um, abs=0.005)


def test_a_gap_is_told_and_weights_are_the_angles_that_points_stand_for() -> None:
    """By hand: 40 points a degree apart, then 32 of 10 deg; 72 points of 5 deg on average."""
    angle = np.concatenate((np.arange(40.0), np.arange(40.0, 360.0, 10.0)))
    weights = angle_weights(angle + 350.0)
    assert weights[[0, 20, 40, 60]] * 5.0 == pytest.approx([5.5, 1.0, 5.5, 10.0])
    assert weights.sum() == pytest.approx(angle.size)
    assert (angle_weights(FULL) == 1.0).all() and (angle_weights(angle[::5]) == 1.0).all()
    angle = FULL[(FULL <= 100) | (FULL >= 145)]
    result = evaluate(angle, part(angle))
    (problem,) = warned(result)
    assert (problem.key, problem.limit) == ("100 - 145 deg", "1.2 um")
    assert float(problem.value.split()[0]) < 0.05
    assert not warned(evaluate(FULL, part(FULL))) and not warned(evaluate(LOST, part(LOST)))


@pytest.mark.parametrize(
    ("gap_deg", "fine_um", "known"), [(20.0, 3.0, True), (45.0, 0.0, True), (45.0, 3.0, False)]
)
def test_a_gap_is_judged_by_its_effect(gap_deg: float, fine_um: float, known: bool) -> None:
    """What 7 and 12 undulations do within 45 deg is not known; within 20 deg, or without them, it is."""
    theta = np.radians(FULL)
    noise = np.random.default_rng(6).normal(0, 0.1, FULL.size)
    whole = part(FULL) + fine_um * (0.5 * np.cos(7 * theta) + 0.3 * np.cos(12 * theta)) + noise
    kept = np.mod(FULL - 77.0, 360.0) >= gap_deg
    if not known:
        problem = refused(FULL[kept], whole[kept])
        assert problem.code == "trace.gap" and problem.limit == "<= 1.3 um"
        assert float(problem.value.split()[0]) > 2.0
        return
    result = evaluate(FULL[kept], whole[kept])
    (problem,) = warned(result)
    assert abs(result.ront_um - evaluate(FULL, whole).ront_um) <= float(problem.value.split()[0])


def test_the_profile_of_an_uneven_trace_is_at_its_own_angles() -> None:
    angle = np.delete(FULL, slice(100, 400))
    expected = centred_profile(FULL, part(FULL))
    np.testing.assert_allclose(
        centred_profile(angle, part(angle)), np.delete(expected, slice(100, 400)), atol=2e-3
    )
    whole_deg, whole_um = profile_of(angle, part(angle))
    np.testing.assert_allclose(whole_um, np.interp(whole_deg, FULL, expected, period=360.0), atol=2e-3)


def burred(first: int, count: int, height_um: float = 8.5) -> Floats:
    noise = np.random.default_rng(7).normal(0, 0.1, FULL.size)
    deviation = np.cos(3 * np.radians(FULL)) + noise
    deviation[np.arange(first, first + count) % 3600] += height_um
    return np.asarray(deviation)


@pytest.mark.parametrize("filter_upr", [None, 50.0])
@pytest.mark.parametrize("first", [1000, 3580])
def test_neighbouring_outliers_are_a_feature_and_stay(first: int, filter_upr: float | None) -> None:
    """A burr of 4 deg, anywhere and across the start of the turn."""
    result = evaluate(FULL, burred(first, 40), filter_upr, robust=True)
    plain = evaluate(FULL, burred(first, 40), filter_upr)
    clean = evaluate(FULL, burred(first, 0), filter_upr)
    (feature,) = result.features
    assert (feature.first_deg, feature.last_deg) == (first / 10, (first + 39) % 3600 / 10)
    assert (feature.points, result.left_out) == (40, 0)
    assert feature.height_um == pytest.approx(8.5, abs=0.5)
    assert result.ront_um == plain.ront_um
    assert result.without_features is not None
    assert result.without_features.ront_um == pytest.approx(clean.ront_um, abs=0.1)


def test_dirt_is_single_points_and_features_are_neighbours() -> None:
    """Three neighbours of 0.1 deg are dirt, four a feature; one sound point between them does not part them."""
    for count, dirt in ((1, True), (3, True), (4, False)):
        result = evaluate(FULL, burred(1000, count), robust=True)
        assert (result.left_out == count, not result.features) == (dirt, dirt)
    fence = burred(1000, 0)
    fence[1000:1020:2] += 8.5
    (feature,) = evaluate(FULL, fence, robust=True).features
    assert (feature.points, feature.last_deg) == (10, 101.8)
    # Of 144 points two side by side are 2.5 deg of the part.
    angle = np.arange(144) * 2.5
    deviation = np.cos(3 * np.radians(angle)) + np.random.default_rng(8).normal(0, 0.05, 144)
    deviation[[20, 21, 80]] += 9.0
    result = evaluate(angle, deviation, None, robust=True)
    assert [(f.first_deg, f.last_deg) for f in result.features] == [(50.0, 52.5)] and result.left_out == 1
