"""Feed hold (H) and program hold: along the path to a stop at Ix95, and on with R."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.simulator.card.coordinate import CoordinateSystem
from tests.drivers.ideal_card import CYCLE_MS, IdealCard, moving_time_ms, refused

LONG = ("INC", "TA20 TS0 TM500", "X10000 Y5000", "X5000 Y2500", "P1=P1+1")


def held(card: IdealCard, *lines: str) -> None:
    """Run a program and hold it in mid-move."""
    card.program(*lines)
    card.system.run()
    card.wait(100)
    card.system.hold()
    card.wait(50)
    assert card.system.motion.held_at is not None


@pytest.fixture
def card() -> IdealCard:
    return IdealCard()


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
