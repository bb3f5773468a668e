"""LINEAR moves against the manual's figures and against an independent construction by convolution."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.trajectory.linear import (
    Limits,
    LinearMove,
    NoAccelerationTimeError,
    Timing,
    at_rest,
    effective_timing,
    lay,
    stop,
)
from drivers.pmac.trajectory.pieces import Piece, position_at, velocity_at

FREE = Limits(velocity=(0.0,), acceleration=(0.0,))


def trajectory(distances: list[float], ta: float, ts: float, tm: float, limits: Limits = FREE) -> list[Piece]:
    blend = at_rest((0.0,))
    pieces: list[Piece] = []
    for distance in distances:
        laid, blend, _ = lay(blend, LinearMove(distance=(distance,), ta_ms=ta, ts_ms=ts, tm_ms=tm), limits)
        pieces.extend(laid)
    pieces.extend(stop(blend, ta, ts, limits))
    return pieces


def sample(pieces: list[Piece], times: np.ndarray) -> np.ndarray:
    positions = np.empty_like(times)
    start = 0.0
    for piece in pieces:
        inside = (times >= start - 1e-12) & (times <= start + piece.duration_ms + 1e-12)
        positions[inside] = [position_at(piece.cubics[0], t - start) for t in times[inside]]
        start += piece.duration_ms
    return positions


def total_ms(pieces: list[Piece]) -> float:
    return sum(piece.duration_ms for piece in pieces)


def peak_velocity(pieces: list[Piece]) -> float:
    """Velocity is extremal at a piece end or where the acceleration passes zero inside a piece."""
    found = []
    for piece in pieces:
        _, _, c2, c3 = piece.cubics[0]
        instants = [0.0, piece.duration_ms]
        if c3 and 0.0 < -c2 / (3 * c3) < piece.duration_ms:
            instants.append(-c2 / (3 * c3))
        found += [abs(velocity_at(piece.cubics[0], t)) for t in instants]
    return max(found)


def timing(ta: float, ts: float, tm: float, distance: float = 0.0, limits: Limits = FREE) -> Timing:
    return effective_timing(LinearMove(distance=(distance,), ta_ms=ta, ts_ms=ts, tm_ms=tm), (0.0,), limits)


def test_two_s_curves_longer_than_ta_set_the_acceleration_time() -> None:
    assert timing(10, 10, 100).ta_ms == 20
    assert timing(0, 7, 100).ta_ms == 14
    assert timing(20, 5, 100).ta_ms == 20


def test_a_move_shorter_than_its_acceleration_takes_the_acceleration_time() -> None:
    assert timing(10, 10, 10).tm_ms == 20
    assert timing(10, 5, 10).tm_ms == 10
    assert timing(10, 0, 25).tm_ms == 25


def test_no_acceleration_time_at_all_is_refused() -> None:
    with pytest.raises(NoAccelerationTimeError):
        timing(0, 0, 10)


def test_a_move_longer_than_the_register_is_done_in_its_greatest_time() -> None:
    assert timing(10, 0, 1e9).tm_ms == 8_388_607


@pytest.mark.parametrize("distance", [100_000, -100_000])
def test_ix16_stretches_the_move_time(distance: float) -> None:
    limits = Limits(velocity=(32.0,), acceleration=(0.0,))
    assert timing(10, 0, 1000, distance=distance, limits=limits).tm_ms == 3125


def test_factory_ix16_slows_the_paper_spindle_to_192_rpm() -> None:
    limits = Limits(velocity=(32.0,), acceleration=(0.0,))
    used = timing(10, 10, 10, distance=10_000 / 6, limits=limits)
    assert used.tm_ms == pytest.approx(52.08, abs=0.01)
    assert 60_000 / (6 * used.tm_ms) == pytest.approx(192.0)


def test_ix17_lengthens_the_acceleration_even_for_the_stop_that_may_follow() -> None:
    limits = Limits(velocity=(0.0,), acceleration=(0.01,))
    used = timing(10, 0, 1000, distance=1000, limits=limits)
    assert used.ta_ms == pytest.approx(100)
    pieces = trajectory([1000], 10, 0, 1000, limits)
    peak = max(abs(2 * p.cubics[0][2] + 6 * p.cubics[0][3] * t) for p in pieces for t in (0, p.duration_ms))
    assert peak == pytest.approx(0.01)


def test_ix17_lengthens_the_acceleration_of_a_move_that_changes_no_speed() -> None:
    """At 1 count/ms before and in the move: the stop that may follow takes 1 / 0.01 ms."""
    limits = Limits(velocity=(0.0,), acceleration=(0.01,))
    goes_on = LinearMove(distance=(1000.0,), ta_ms=10.0, ts_ms=0.0, tm_ms=1000.0)
    assert effective_timing(goes_on, (1.0,), limits).ta_ms == pytest.approx(100.0)


def test_single_triangle_move_of_the_manual() -> None:
    pieces = trajectory([1.0], 10, 0, 10)
    assert total_ms(pieces) == pytest.approx(20)
    assert peak_velocity(pieces) == pytest.approx(0.1)


@pytest.mark.parametrize(("ts", "peak"), [(0.0, 0.75), (5.0, 0.8333333333)])
def test_reversal_turns_round_short_of_its_target(ts: float, peak: float) -> None:
    pieces = trajectory([1.0, -1.0], 10, ts, 10)
    times = np.linspace(0, total_ms(pieces), 30_001)
    positions = sample(pieces, times)
    assert total_ms(pieces) == pytest.approx(30)
    assert positions.max() == pytest.approx(peak, abs=1e-6)
    assert positions[-1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(("ta", "ts", "kept"), [(20, 10, 2 / 3), (20, 0, 1 / 2), (10, 5, 5 / 6), (10, 0, 3 / 4)])
def test_zig_zag_keeps_the_share_of_its_stroke_that_the_rules_leave(ta: float, ts: float, kept: float) -> None:
    """Peak to peak of alternating moves is 1 - TA/(3 TM) with full S-curves, 1 - TA/(2 TM) with ramps."""
    pieces = trajectory([275.0, -275.0] * 6, ta, ts, 20)
    times = np.linspace(60, 180, 24_001)
    positions = sample(pieces, times)
    assert np.ptp(positions) == pytest.approx(275 * kept, rel=1e-6)


def test_a_long_blend_is_cut_to_the_room_in_the_move_before_it() -> None:
    """TA(i+1) <= 2 (TM(i) - TA(i)/2)."""
    blend = at_rest((0.0,))
    _, blend, _ = lay(blend, LinearMove(distance=(10.0,), ta_ms=10, ts_ms=0, tm_ms=12), FREE)
    _, _, used = lay(blend, LinearMove(distance=(100.0,), ta_ms=50, ts_ms=20, tm_ms=200), FREE)
    assert used.ta_ms == pytest.approx(2 * (12 - 5))
    assert used.ts_ms == pytest.approx(7)


def test_an_s_curve_blend_misses_its_corner_by_a_twelfth() -> None:
    """At the boundary between two moves: (v2 - v1) TA / 12 for a pure S-curve, / 8 for a ramp."""
    for ts, divisor in ((0.0, 8), (10.0, 12)):
        pieces = trajectory([40.0, 120.0], 20, ts, 40)
        corner = sample(pieces, np.array([10.0 + 40.0]))[0]
        assert corner - 40.0 == pytest.approx((3.0 - 1.0) * 20 / divisor)


def convolved(distances: list[float], ta: float, ts: float, tm: float, step: float) -> np.ndarray:
    """Velocity steps convolved with box(TA - TS) and box(TS): the rules for constant TA and TS."""
    per_move = round(tm / step)
    velocity = np.repeat(np.asarray(distances) / tm, per_move)
    for width in (ta - ts, ts):
        count = round(width / step)
        if count:
            velocity = np.convolve(velocity, np.full(count, 1.0 / count))
    return np.concatenate([[0.0], np.cumsum(velocity) * step])


@given(
    distances=st.lists(st.integers(-1000, 1000), min_size=1, max_size=6),
    ts=st.integers(0, 4),
    plateau=st.integers(0, 6),
    extra=st.integers(0, 10),
)
def test_blending_is_velocity_steps_convolved_with_two_boxes(
    distances: list[int], ts: int, plateau: int, extra: int
) -> None:
    ta = 2 * ts + plateau
    if ta == 0:
        return
    tm, step = ta + extra, 1 / 16
    pieces = trajectory([float(d) for d in distances], ta, ts, tm)
    expected = convolved([float(d) for d in distances], ta, ts, tm, step)
    times = np.arange(len(expected)) * step
    assert times[-1] == pytest.approx(total_ms(pieces), abs=2 * step)
    inside = times <= total_ms(pieces)
    # A box sampled at `step` spreads each velocity over one step: half a step of slope is its own error.
    slack = max(abs(d) for d in distances) / tm * step + 1e-9
    assert np.max(np.abs(sample(pieces, times[inside]) - expected[inside])) <= slack


@given(
    moves=st.lists(
        st.tuples(st.integers(-500, 500), st.integers(1, 40), st.integers(0, 30), st.integers(1, 60)),
        min_size=1,
        max_size=8,
    )
)
def test_any_sequence_is_continuous_and_ends_where_it_was_told(moves: list[tuple[int, int, int, int]]) -> None:
    blend = at_rest((0.0,))
    pieces: list[Piece] = []
    for distance, ta, ts, tm in moves:
        move = LinearMove(distance=(float(distance),), ta_ms=ta, ts_ms=ts, tm_ms=tm)
        laid, blend, _ = lay(blend, move, FREE)
        pieces.extend(laid)
    pieces.extend(stop(blend, moves[-1][1], moves[-1][2], FREE))
    position, velocity = 0.0, 0.0
    for piece in pieces:
        assert piece.duration_ms > 0
        assert position_at(piece.cubics[0], 0.0) == pytest.approx(position, abs=1e-6)
        assert velocity_at(piece.cubics[0], 0.0) == pytest.approx(velocity, abs=1e-7)
        position = position_at(piece.cubics[0], piece.duration_ms)
        velocity = velocity_at(piece.cubics[0], piece.duration_ms)
    assert position == pytest.approx(sum(move[0] for move in moves), abs=1e-6)
    assert velocity == pytest.approx(0, abs=1e-7)
