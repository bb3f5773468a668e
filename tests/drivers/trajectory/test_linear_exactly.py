"""LINEAR moves with constant TA and TS against velocity steps convolved with two boxes, in exact fractions.

The velocity of a LINEAR sequence is the steps of its moves convolved with a box of TA - TS and one of TS. Each
step of the velocity therefore adds its height times a fixed curve, which is written down below with truncated
powers; nothing of it is in the planner.
"""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drivers.trajectory.motion import Motion, assert_smooth, linear, motion


def after(t: Fraction, power: int) -> Fraction:
    return t**power if t > 0 else Fraction(0)


def risen(t: Fraction, wide: int, narrow: int) -> Fraction:
    """The double integral of a step of velocity 1 at 0, convolved with boxes of these widths."""
    if narrow == 0:
        return (after(t, 2) - after(t - wide, 2)) / (2 * wide)
    corners = after(t, 3) - after(t - wide, 3) - after(t - narrow, 3) + after(t - wide - narrow, 3)
    return corners / (6 * wide * narrow)


def expected(distances: list[int], ta: int, ts: int, tms: list[int], t: Fraction) -> Fraction:
    position, boundary, before = Fraction(0), Fraction(0), Fraction(0)
    for distance, tm in zip(distances, tms, strict=True):
        velocity = Fraction(distance, tm)
        position += (velocity - before) * risen(t - boundary, ta - ts, ts)
        before, boundary = velocity, boundary + tm
    return position - before * risen(t - boundary, ta - ts, ts)


def sequence(distances: list[int], ta: int, ts: int, tms: list[int]) -> Motion:
    position, requests = 0, []
    for distance, tm in zip(distances, tms, strict=True):
        position += distance
        requests.append(linear(ta, ts, tm, X=float(position)))
    return motion(requests, settings={187: ta, 188: ts})


@given(
    moves=st.lists(st.tuples(st.integers(-1000, 1000), st.integers(0, 20)), min_size=1, max_size=7),
    ts=st.integers(0, 8),
    plateau=st.integers(0, 9),
)
def test_blending_is_velocity_steps_convolved_with_two_boxes_to_the_last_digits(
    moves: list[tuple[int, int]], ts: int, plateau: int
) -> None:
    ta = 2 * ts + plateau or 1
    distances, tms = [distance for distance, _ in moves], [ta + extra for _, extra in moves]
    made = sequence(distances, ta, ts, tms)
    stroke = max(1.0, sum(abs(distance) for distance in distances))
    total = sum(tms) + ta
    assert made.duration_ms == pytest.approx(total, abs=1e-9)
    for t in (Fraction(total * k, 40) for k in range(41)):
        assert made.at(float(t)) == pytest.approx(float(expected(distances, ta, ts, tms, t)), abs=1e-9 * stroke)
    assert_smooth(made.pieces, (0.0,), stroke)


@pytest.mark.parametrize(("ta", "ts"), [(20, 0), (20, 5), (20, 10)])
def test_rule_1_to_3_at_the_boundary_the_path_is_off_its_point_by_the_known_share(ta: int, ts: int) -> None:
    """(v2 - v1) [(TA - TS)/8 + TS^2 / (24 (TA - TS))]."""
    made = sequence([40, 120], ta, ts, [40, 40])
    off = (3.0 - 1.0) * ((ta - ts) / 8 + ts**2 / (24 * (ta - ts)))
    assert made.at(ta / 2 + 40) - 40.0 == pytest.approx(off, abs=1e-12)


def test_rule_8_the_ta_in_force_at_the_stop_shapes_the_stop() -> None:
    made = motion([linear(10, 0, 100, X=100.0)], settings={187: 50, 188: 0})
    assert made.duration_ms == pytest.approx(10 / 2 + 100 + 50 / 2)


def test_rule_6_a_feedrate_move_beyond_the_register_is_done_in_its_greatest_time() -> None:
    made = motion([linear(10, 0, 1e9, X=1.0)])
    assert made.duration_ms == pytest.approx(8_388_607 + 10)


def test_timing_a_sequence_takes_half_a_ramp_more_at_both_ends() -> None:
    """TA/2 + sum of TM + TA/2, also when the times differ from move to move."""
    made = motion([linear(10, 0, 30, X=1.0), linear(20, 5, 40, X=5.0)], settings={187: 20, 188: 5})
    assert made.duration_ms == pytest.approx(10 / 2 + 30 + 40 + 20 / 2)
