"""SPLINE1 and SPLINE2 against the B-splines of SciPy and the way-points of the manual."""

from __future__ import annotations

from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from drivers.pmac.requests import DwellRequest, Request
from drivers.pmac.trajectory.pieces import velocity_at
from tests.drivers.trajectory.motion import Motion, assert_smooth, linear, motion, planner_for, pvt, splined

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


def b_spline(points: list[float], times: list[float]) -> BSpline:
    """The cubic B-spline over the segments of `times` and one more, as long as its neighbour, at each end.

    It rests at both ends: the outermost points are threefold, and the knots beyond the ends are as far apart
    as the last ones inside.
    """
    from scipy.interpolate import BSpline

    spans = [times[0], *times, times[-1]]
    knots = [0.0, *accumulate(spans)]
    before = [-k * spans[0] for k in (3, 2, 1)]
    behind = [knots[-1] + k * spans[-1] for k in (1, 2, 3)]
    coefficients = [0.0, 0.0, 0.0, *points, points[-1], points[-1]]
    return BSpline(np.array([*before, *knots, *behind]), np.array(coefficients), 3)


def spline_motion(points: list[float], times: list[float], uniform: bool) -> Motion:
    requests = [splined(ms, uniform=uniform, X=p) for p, ms in zip(points, times, strict=True)]
    return motion(requests)


POINTS = st.lists(st.integers(-1000, 1000).map(float), min_size=1, max_size=8)


@given(points=POINTS, ms=st.integers(1, 200))
def test_spline1_is_the_uniform_cubic_b_spline(points: list[float], ms: int) -> None:
    times = [float(ms)] * len(points)
    made, expected = spline_motion(points, times, True), b_spline(points, times)
    stroke = max(1.0, *map(abs, points))
    for t in np.linspace(0.0, made.duration_ms, 101):
        assert made.at(t) == pytest.approx(float(expected(t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


@given(moves=st.lists(st.tuples(st.integers(-1000, 1000).map(float), st.integers(1, 90)), min_size=1, max_size=8))
def test_spline2_is_the_non_uniform_cubic_b_spline(moves: list[tuple[float, int]]) -> None:
    points, times = [p for p, _ in moves], [float(ms) for _, ms in moves]
    made, expected = spline_motion(points, times, False), b_spline(points, times)
    stroke = max(1.0, *map(abs, points))
    assert made.duration_ms == pytest.approx(times[0] + sum(times) + times[-1])
    for t in np.linspace(0.0, made.duration_ms, 101):
        assert made.at(t) == pytest.approx(float(expected(t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


def test_section_10_number_8_the_way_point_of_0_1_0_is_two_thirds() -> None:
    made = spline_motion([1.0, 0.0], [10.0, 10.0], True)
    assert made.at(20.0) == pytest.approx((0 + 4 * 1 + 0) / 6, abs=1e-12)


def test_section_10_number_8_alternating_points_reach_a_third() -> None:
    made = spline_motion([1.0, -1.0] * 5, [10.0] * 10, True)
    reached = [made.at(10.0 * k) for k in range(3, 10)]
    assert reached == pytest.approx([sign / 3 for sign in (-1, 1, -1, 1, -1, 1, -1)], abs=1e-12)


def test_the_velocity_at_a_way_point_is_that_between_its_neighbours() -> None:
    """V(i) = (P(i+1) - P(i-1)) / (2 T)."""
    made = spline_motion([30.0, 50.0, 10.0], [20.0] * 3, True)
    assert made.velocity(40.0) == pytest.approx((50.0 - 0.0) / 40.0)
    assert made.velocity(60.0) == pytest.approx((10.0 - 30.0) / 40.0)


def test_the_inside_shift_is_a_sixth_of_the_change_of_distance() -> None:
    """Diff(i) = (Dist(i+1) - Dist(i)) / 6."""
    made = spline_motion([30.0, 50.0, 10.0], [20.0] * 3, True)
    assert made.at(40.0) - 30.0 == pytest.approx((20.0 - 30.0) / 6)
    assert made.at(60.0) - 50.0 == pytest.approx((-40.0 - 20.0) / 6)


@pytest.mark.parametrize("segments", [1, 2, 3, 4])
def test_n_segments_take_two_segment_times_more(segments: int) -> None:
    made = spline_motion([float(k) for k in range(1, segments + 1)], [25.0] * segments, True)
    assert made.duration_ms == pytest.approx((segments + 2) * 25.0)
    assert made.end() == pytest.approx(segments)


def test_spline1_stops_and_begins_again_when_its_time_changes() -> None:
    made = motion([splined(10, X=4.0), splined(10, X=8.0), splined(20, X=12.0)])
    assert made.duration_ms == pytest.approx(4 * 10 + 3 * 20)
    assert made.at(40.0) == pytest.approx(8.0, abs=1e-12)
    assert made.velocity(40.0) == pytest.approx(0.0, abs=1e-12)


def test_spline2_goes_on_when_its_time_changes() -> None:
    made = motion([splined(10, uniform=False, X=4.0), splined(20, uniform=False, X=8.0)])
    assert made.duration_ms == pytest.approx(10 + 10 + 20 + 20)
    assert min(made.velocity(t) for t in np.linspace(5.0, 50.0, 46)) > 0.01


def test_the_acceleration_of_a_spline_has_no_jumps() -> None:
    made = motion([splined(ms, uniform=False, X=p) for p, ms in ((5.0, 10), (9.0, 35), (-3.0, 20))])
    for piece, following in pairwise(made.pieces):
        _, _, c2, c3 = piece.cubics[0]
        assert 2 * c2 + 6 * c3 * piece.duration_ms == pytest.approx(2 * following.cubics[0][2], abs=1e-12)


def test_one_point_of_spline1_is_calculated_ahead_of_the_motion() -> None:
    """The segment that is laid with a point is the one before it, and the next point is asked for as it begins."""
    planner = planner_for([splined(10, X=6.0), splined(10, X=0.0)])
    first = planner.plan()
    assert [piece.calculates for piece in first.pieces] == [True]
    assert velocity_at(first.pieces[0].cubics[0], 10.0) == pytest.approx(6.0 / 20.0)


@pytest.mark.parametrize("other", [linear(X=9.0, tm=30), pvt(30, X=9.0), DwellRequest(duration_ms=30)])
def test_another_move_mode_lets_a_spline_come_to_rest_at_its_point(other: Request) -> None:
    made = motion([splined(10, X=6.0), other])
    assert made.at(30.0) == pytest.approx(6.0, abs=1e-12)
    assert made.velocity(30.0) == pytest.approx(0.0, abs=1e-12)


def test_a_segment_without_a_time_is_a_run_time_error() -> None:
    with pytest.raises(PmacError, match="0 ms"):
        motion([splined(0, X=6.0)])
