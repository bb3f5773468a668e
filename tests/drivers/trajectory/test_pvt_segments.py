"""PVT segments against SciPy's Hermite splines and the distances of the manual's figure."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from tests.drivers.trajectory.motion import assert_smooth, linear, motion, planner_for, pvt


@given(
    segments=st.lists(
        st.tuples(st.integers(-1000, 1000), st.integers(-20, 20), st.integers(1, 300)), min_size=1, max_size=8
    )
)
def test_a_pvt_sequence_is_the_cubic_hermite_spline_of_its_points(segments: list[tuple[int, int, int]]) -> None:
    from scipy.interpolate import CubicHermiteSpline

    requests = [pvt(float(ms), float(v), X=float(p)) for p, v, ms in segments]
    rest = pvt(50.0, 0.0, X=0.0)
    made = motion([*requests, rest])
    points, speeds = [0, *(p for p, _, _ in segments), 0], [0, *(v for _, v, _ in segments), 0]
    times = [0, *accumulate([*(ms for _, _, ms in segments), 50])]
    expected = CubicHermiteSpline(times, points, speeds)
    stroke = max(1.0, *(abs(p) + abs(v) * ms for p, v, ms in segments))
    for t in np.linspace(0.0, times[-1], 101):
        assert made.at(t) == pytest.approx(float(expected(t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


@pytest.mark.parametrize(
    ("before", "after", "share", "halfway"),
    [(0.0, 6.0, 1 / 2, 3.0), (0.0, 6.0, 1 / 3, 1.5), (0.0, 6.0, 2 / 3, 4.5), (6.0, 6.0, 1.0, 6.0)],
)
def test_the_manual_s_building_blocks(before: float, after: float, share: float, halfway: float) -> None:
    """Half of V t ramps the velocity straight, a third and two thirds bend it as parabolas, V t keeps it."""
    lead = [pvt(10.0, before, X=0.0)] if before else []
    start_ms = 10.0 * len(lead)
    made = motion([*lead, pvt(30.0, after, X=share * 6.0 * 30.0), pvt(30.0, 0.0, X=500.0)])
    assert made.velocity(start_ms + 15.0) == pytest.approx(halfway)


def test_a_sequence_that_does_not_end_at_rest_is_a_run_time_error() -> None:
    with pytest.raises(PmacError, match="at rest"):
        motion([pvt(10.0, 1.0, X=5.0), linear(X=9.0)])


def test_a_program_that_is_given_up_in_pvt_ramps_down_from_where_it_is() -> None:
    planner = planner_for([pvt(10.0, 2.0, X=10.0)])
    planner.plan()
    (piece,) = planner.halt((0.5,))
    assert piece.duration_ms == pytest.approx(2.0 / 0.5)
    assert planner.target[0] == pytest.approx(10.0 + 2.0 * 4.0 / 2)
    assert planner.plan().finished


def test_a_segment_without_a_time_is_a_run_time_error() -> None:
    with pytest.raises(PmacError, match="0 ms"):
        motion([pvt(0.0, X=6.0)])
