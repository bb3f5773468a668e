"""R, S, Q, A, `/`, B, H and STOP: where a program stops, and where it goes on."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.simulator.card.coordinate import CoordinateSystem
from tests.drivers.wire_card import CYCLE_MS, IdealCard, moving_time_ms, refused, rests, said

THREE = ("INC", "TA20 TS0 TM100", "X1000", "P1=P1+1", "X1000", "P1=P1+1", "X1000", "P1=P1+1")


@pytest.fixture
def card() -> IdealCard:
    return IdealCard()


def started(card: IdealCard, *lines: str, after_ms: float = 50.0) -> None:
    card.program(*lines)
    card.system.run()
    card.wait(after_ms)


def test_q_plays_what_is_calculated_and_r_goes_on_with_the_next_move(card: IdealCard) -> None:
    started(card, *THREE)
    card.system.quit()
    card.settle()
    assert card.x == 2000, "the move under way and the one that was calculated"
    assert card.get("P1") == 1, "what stands behind them is not yet done"
    card.system.run()
    card.settle()
    assert card.x == 3000
    assert card.get("P1") == 3, "nothing is done twice"


def test_q_sets_the_single_step_bit_and_r_clears_it(card: IdealCard) -> None:
    started(card, *THREE)
    assert said(card.system.motion, "single_step", "running") == ["running"]
    card.system.quit()
    assert said(card.system.motion, "single_step", "running") == ["single_step"]
    card.settle()
    card.system.run()
    assert said(card.system.motion, "single_step", "running") == ["running"]


def test_011_until_the_stop_is_done(card: IdealCard) -> None:
    started(card, *THREE)
    assert refused(card.system.run) == 1
    card.system.quit()
    assert refused(card.system.run) == 11
    assert refused(card.system.step) == 11
    card.settle()
    card.system.run()


def test_a_quit_in_pvt_ramps_down_and_the_program_goes_on_from_there(card: IdealCard) -> None:
    started(card, "ABS", "PVT200", "X2000:10000", "X4000:10000", "X6000:10000", "X7000:0", after_ms=250)
    card.system.quit()
    card.settle()
    # The third segment was calculated when the second began; 10 counts/ms at Ix15 = 1 count/ms2 is 50 counts.
    assert card.x == pytest.approx(6050)
    card.system.run()
    card.settle()
    assert card.x == 7000


def test_s_makes_one_move_at_a_time(card: IdealCard) -> None:
    card.program(*THREE)
    for count in (1, 2, 3):
        card.system.step()
        assert card.system.motion.single_step
        card.settle()
        assert card.x == 1000 * count
        assert card.get("P1") == count - 1
    card.system.step()
    card.settle()
    assert card.get("P1") == 3
    assert not card.system.running


def test_r_after_s_runs_the_rest(card: IdealCard) -> None:
    card.program(*THREE)
    card.system.step()
    card.settle()
    track = card.record(card.system.run, card.settle)
    assert card.x == 3000
    assert rests(track) == []


def test_what_stands_between_blockstart_and_blockstop_is_one_step(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM100", "BSTART", "X1000", "X1000", "BSTOP", "X1000")
    track = card.record(card.system.step, card.settle)
    assert card.x == 2000
    assert rests(track) == [], "the two are blended"
    card.system.step()
    card.settle()
    assert card.x == 3000


def test_stop_in_a_program_rests_until_r(card: IdealCard) -> None:
    started(card, "INC", "TA20 TS0 TM100", "X1000", "STOP", "P1=1", "X1000", after_ms=1000)
    assert (card.x, card.get("P1")) == (1000, 0)
    assert not card.system.running
    card.system.run()
    card.settle()
    assert (card.x, card.get("P1")) == (2000, 1)


@pytest.mark.parametrize(("ms", "rest"), [(20, 1000), (80, 1000), (104, 2000), (150, 2000)])
def test_the_end_of_block_stop_ends_the_move_that_is_played_in_segments(ms: float, rest: float) -> None:
    """The ramp into the second move begins at 100 ms; what was calculated of it is made later."""
    card = IdealCard(I13=10)
    card.program(*THREE)
    track = card.record(
        card.system.run, lambda: card.wait(ms - 5), card.system.stop_at_block, card.settle, card.system.run
    )
    assert card.system.program_counter()[1] < 7
    assert card.x == pytest.approx(rest)
    assert np.abs(np.diff(track, 2)).max() <= 0.5 * CYCLE_MS**2 * 1.001, "10 counts/ms in 20 ms, and no jump"
    card.settle()
    assert card.x == pytest.approx(3000)
    assert card.get("P1") == 3


def test_an_arc_ends_at_its_point(card: IdealCard) -> None:
    card.set(I13=10)
    card.program(
        "ABS TA20 TS0 TM200", "CIRCLE1 X1000 Y1000 I1000 J0", "CIRCLE1 X2000 Y0 I0 J-1000", "LINEAR X0 Y0"
    )
    card.system.run()
    card.wait(150)
    card.system.stop_at_block()
    card.settle()
    assert [card.x, card.motor(2).desired] == pytest.approx([1000, 1000])
    card.system.run()
    card.settle()
    assert [card.x, card.motor(2).desired] == pytest.approx([0, 0])


def test_the_end_of_block_stop_is_a_quit_without_segments(card: IdealCard) -> None:
    started(card, *THREE)
    card.system.stop_at_block()
    assert said(card.system, "end_of_block_stop")
    card.settle()
    assert card.x == 2000
    card.system.run()
    assert not said(card.system, "end_of_block_stop")
    card.settle()
    assert card.x == 3000


def test_017_a_motor_was_moved_since_the_stop(card: IdealCard) -> None:
    started(card, *THREE)
    card.system.quit()
    card.settle()
    card.motor(2).jog_to(100)
    card.settle()
    assert refused(card.system.run) == 17
    assert refused(card.system.step) == 17
    assert said(card.system, "resume_error")
    card.motor(2).jog_back()
    card.settle()
    card.system.run()
    assert not said(card.system, "resume_error")
    card.settle()
    assert card.x == 3000


def test_pmatch_takes_the_motors_as_they_are(card: IdealCard) -> None:
    started(card, "ABS", *THREE[1:])
    card.system.quit()
    card.settle()
    card.motor(2).jog_to(100)
    card.settle()
    card.system.match_positions()
    card.system.run()
    card.settle()
    assert card.motor(2).desired == 100, "the axis is where the motor is"


def test_after_an_abort_r_goes_on_behind_what_was_calculated(card: IdealCard) -> None:
    """The manual: the program can be resumed, and what was calculated is lost."""
    started(card, "ABS", "TA20 TS0 TM100", "X1000", "P1=1", "X2000", "P1=2", "X3000", "P1=3")
    card.system.abort()
    card.settle()
    assert card.get("P1") == 1
    assert card.x < 1000
    card.system.run()
    card.settle()
    assert card.get("P1") == 3
    assert card.x == 3000


@pytest.mark.parametrize(
    ("mode", "end"),
    [
        # Stopped at 1000 and jogged to 1500: three distances of 1000 are left.
        ("INC", 4500),
        # Places stay places.
        ("ABS", 4000),
    ],
)
def test_a_move_taken_back_starts_from_where_the_motor_is(card: IdealCard, mode: str, end: float) -> None:
    card.set(I13=5)
    places = (1000, 1000, 1000, 1000) if mode == "INC" else (1000, 2000, 3000, 4000)
    started(card, mode, "TA10 TS0 TM500", *(f"X{place}" for place in places), after_ms=200)
    card.system.stop_at_block()
    card.settle()
    assert card.x == 1000
    card.motor().jog_to(1500)
    card.settle()
    card.system.match_positions()
    card.system.run()
    card.settle()
    assert card.x == end
    assert max(card.track[1]) == end, "no way there and back"


def test_a_spline_that_looks_ahead_goes_on_from_where_an_abort_left_it(card: IdealCard) -> None:
    started(card, "INC", "SPLINE2 TA300", *["X100"] * 6, after_ms=700)
    card.system.abort()
    card.settle()
    stopped, seen = card.x, len(card.track[1])
    card.system.run()
    card.settle()
    left = (card.x - stopped) / 100
    assert left == pytest.approx(round(left), abs=1e-9), "whole distances of 100 are left"
    assert card.x > stopped
    assert np.all(np.diff(card.track[1][seen:]) >= -1e-9), "never back"


def test_b_forgets_where_the_program_was_and_is_refused_while_it_runs(card: IdealCard) -> None:
    started(card, *THREE)
    card.system.quit()
    card.settle()
    card.system.point(1)
    card.system.run()
    card.settle()
    assert card.x == 2000 + 3000
    started(card, *THREE)
    assert refused(lambda: card.system.point(1)) == 1


def test_b_may_name_a_label(card: IdealCard) -> None:
    card.store("INC", "TA20 TS0 TM100", "X1000", "N200", "X50", number=7)
    card.system.point(7, 200)
    card.system.run()
    card.settle()
    assert card.x == pytest.approx(50)
    card.system.run()
    card.settle()
    assert card.x == pytest.approx(50 + 1050), "at the end the counter goes to the top"


def test_a_program_that_has_ended_begins_again(card: IdealCard) -> None:
    started(card, *THREE)
    card.settle()
    card.system.run()
    card.settle()
    assert card.x == 6000


def test_a_runtime_error_is_not_gone_on_from(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM100", "X1000", "GOTO99", "X5000")
    card.system.run()
    card.settle()
    assert said(card.system.motion, "runtime_error")
    assert card.x == 1000
    card.system.run()
    assert not said(card.system.motion, "runtime_error")
    card.settle()
    assert card.x == 2000


def test_the_program_counter_is_ahead_of_what_is_executed(card: IdealCard) -> None:
    card.program("INC TA20 TS0 TM100", "X1000", "X1000", "X1000")
    assert card.system.program_counter() == (1, 0)
    card.system.run()
    card.wait(50)
    assert card.system.program_counter() == (1, 2)
    assert card.system.executing() == (1, 1)
    card.settle()
    assert card.system.program_counter() == (1, 0)


def test_both_look_into_a_called_program(card: IdealCard) -> None:
    card.store("X1000", "X1000", "X1000", number=500)
    card.program("INC TA20 TS0 TM100", "CALL 500", "X1")
    card.system.run()
    card.wait(50)
    assert card.system.program_counter() == (500, 1)
    assert card.system.executing() == (500, 0)
    card.settle()
    assert card.x == 3001


def test_all_systems_at_once(card: IdealCard) -> None:
    card.program(*THREE)
    card.controller.each_system(CoordinateSystem.step)
    card.settle()
    assert card.x == 1000
    card.controller.each_system(CoordinateSystem.run)
    card.wait(50)
    card.controller.each_system(CoordinateSystem.quit)
    card.settle()
    assert card.x == 3000


# Feed hold (H) and program hold: along the path to a stop at Ix95, and on with R.

LONG = ("INC", "TA20 TS0 TM500", "X10000 Y5000", "X5000 Y2500", "P1=P1+1")


def held(card: IdealCard, *lines: str) -> None:
    """Run a program and hold it in mid-move."""
    card.program(*lines)
    card.system.run()
    card.wait(100)
    card.system.hold()
    card.wait(50)
    assert card.system.motion.held_at is not None


def test_the_path_is_kept_while_it_slows_down_and_speeds_up() -> None:
    card = IdealCard(I195=10_000)
    start = len(card.track[1])
    card.program(*LONG)
    card.system.run()
    for _ in range(3):
        card.wait(150)
        card.system.hold()
        card.wait(400)
        card.system.run()
    card.settle()
    x, y = (np.array(card.track[motor][start:]) for motor in (1, 2))
    assert y == pytest.approx(x / 2, abs=1e-9)
    assert (x[-1], y[-1]) == pytest.approx((15_000, 7_500))
    assert np.diff(x).min() >= 0
    assert np.abs(np.diff(x, 2)).max() < 20 / CYCLE_MS * 0.1


def test_both_the_stop_and_the_start_slew_at_ix95_and_not_at_ix94() -> None:
    """3 713 707 / 4000 = 928 servo cycles are 411 ms, either way."""
    card = IdealCard(I194=400_000, I195=4000)
    card.program("INC", "TA20 TS0 TM60000", "X600000")
    card.system.run()
    card.wait(100)
    down = card.record(card.system.hold, lambda: card.wait(800))
    assert moving_time_ms(down) == pytest.approx(411, abs=1)
    up = card.record(card.system.run, lambda: card.wait(800))
    full = np.flatnonzero(np.diff(up) > 10 * CYCLE_MS * (1 - 1e-9))[0]
    assert float(full) * CYCLE_MS == pytest.approx(411, abs=1)
    override = card.record(lambda: card.system.set_override(50), lambda: card.wait(100))
    assert np.diff(override)[20] == pytest.approx(5 * CYCLE_MS), "from then on it is Ix94 again"


def test_a_held_program_still_runs_and_is_not_in_position(card: IdealCard) -> None:
    held(card, *LONG)
    assert card.system.running
    assert card.system.time_base.percent == 0
    assert card.motor().velocity == 0
    assert not card.motor().in_position


def test_held_motors_may_be_jogged_and_come_back_with_j_equals(card: IdealCard) -> None:
    held(card, *LONG)
    here = card.x
    for target in (here + 500, here - 700):
        card.controller.refuse_in_control(1)
        card.motor().jog_to(target)
        card.wait(100)
        assert card.x == pytest.approx(target)
        assert refused(card.system.run) == 17
        assert refused(card.system.step) == 17
    card.motor().jog_back()
    card.wait(100)
    assert card.x == pytest.approx(here, abs=1e-9)
    card.system.run()
    card.settle()
    assert card.x == pytest.approx(15_000)
    assert card.get("P1") == 1


def test_a_motor_that_still_jogs_is_off_its_place(card: IdealCard) -> None:
    held(card, *LONG)
    card.motor().jog_speed(1)
    assert refused(card.system.run) == 17


def test_s_goes_on_to_the_end_of_the_move_and_rests(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM300", "X1000", "X1000", "X1000", "X1000", "X1000")
    card.system.run()
    card.wait(100)
    card.system.hold()
    card.wait(50)
    card.system.step()
    card.settle()
    # The second move was calculated when the first began, the third is the one that S asks for.
    assert card.x == 3000
    assert card.system.motion.single_step
    card.system.run()
    card.settle()
    assert card.x == 5000


def test_a_run_before_the_hold_is_complete_turns_it_round() -> None:
    card = IdealCard(I195=1644)
    card.program("INC", "TA20 TS0 TM60000", "X600000")
    card.system.run()
    card.wait(100)
    card.system.hold()
    card.wait(300)
    assert card.system.time_base.percent == pytest.approx(70, abs=2)
    card.system.run()
    card.wait(350)
    assert card.system.time_base.percent == 100


def test_a_dwell_ends_in_its_own_time_and_then_nothing_moves(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM100", "X1000", "DWELL300", "P2=1", "X1000")
    card.system.run()
    card.wait(200)
    card.system.hold()
    card.wait(1000)
    assert card.get("P2") == 1, "the move after the DWELL is calculated"
    assert card.x == 1000, "and held"
    card.system.run()
    card.settle()
    assert card.x == 2000


def test_an_abort_ends_the_hold_with_the_motion(card: IdealCard) -> None:
    held(card, *LONG)
    card.system.abort()
    card.settle()
    card.program("INC", "TA20 TS0 TM100", "X1000")
    track = card.record(card.system.run, card.settle)
    assert moving_time_ms(track) == pytest.approx(120, abs=2 * CYCLE_MS)


def test_a_program_hold_without_segments_is_a_feed_hold(card: IdealCard) -> None:
    card.program(*LONG)
    card.system.run()
    card.wait(100)
    card.system.quick_hold()
    card.wait(50)
    assert (card.system.program_hold, card.system.motion.held_at is None) == (True, False)
    card.system.run()
    card.settle()
    assert (card.system.program_hold, card.system.motion.held_at is None) == (False, True)
    assert card.x == pytest.approx(15_000)


def test_all_systems_are_held_and_run_together(card: IdealCard) -> None:
    card.program(*LONG)
    card.controller.each_system(CoordinateSystem.run)
    card.wait(100)
    card.controller.each_system(CoordinateSystem.hold)
    card.wait(50)
    assert card.system.motion.held_at is not None
    card.controller.each_system(CoordinateSystem.run)
    card.settle()
    assert card.x == pytest.approx(15_000)
