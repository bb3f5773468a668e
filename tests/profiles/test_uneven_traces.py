"""Traces with unequal steps, gaps and features, against parts whose roundness is known.

The part is 10 cos 3t + 3 cos 2(t - 151.35 deg): its RONt is that of a quadrature with 360 000 points.
"""

import numpy as np
import pytest

from profiles.arrays import Floats
from profiles.metrology.points import angle_weights
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult, centred_profile, evaluate, profile_of

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


def test_weights_are_the_angles_that_points_stand_for() -> None:
    """By hand: 40 points a degree apart, then 32 of 10 deg; 72 points of 5 deg on average."""
    angle = np.concatenate((np.arange(40.0), np.arange(40.0, 360.0, 10.0)))
    weights = angle_weights(angle + 350.0)
    assert weights[[0, 20, 40, 60]] * 5.0 == pytest.approx([5.5, 1.0, 5.5, 10.0])
    assert weights.sum() == pytest.approx(angle.size)
    assert (angle_weights(FULL) == 1.0).all() and (angle_weights(angle[::5]) == 1.0).all()


def test_a_gap_is_told_with_what_it_may_change() -> None:
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


def test_dirt_is_single_points_or_a_few() -> None:
    """Three neighbours of 0.1 deg are dirt, four a feature; one sound point between them does not part them."""
    for count, dirt in ((1, True), (3, True), (4, False)):
        result = evaluate(FULL, burred(1000, count), robust=True)
        assert (result.left_out == count, not result.features) == (dirt, dirt)
    fence = burred(1000, 0)
    fence[1000:1020:2] += 8.5
    (feature,) = evaluate(FULL, fence, robust=True).features
    assert (feature.points, feature.last_deg) == (10, 101.8)


def test_two_neighbours_far_apart_are_a_feature() -> None:
    """Of 144 points two side by side are 2.5 deg of the part."""
    angle = np.arange(144) * 2.5
    deviation = np.cos(3 * np.radians(angle)) + np.random.default_rng(8).normal(0, 0.05, 144)
    deviation[[20, 21, 80]] += 9.0
    result = evaluate(angle, deviation, None, robust=True)
    assert [(f.first_deg, f.last_deg) for f in result.features] == [(50.0, 52.5)] and result.left_out == 1
