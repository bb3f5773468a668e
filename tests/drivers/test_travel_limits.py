"""Travel limits: Ix13 and Ix14, the switches at the ends, and what they leave a motor and a program to do."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect, Setting
from tests.drivers.ideal_card import BLOCK, CYCLE_MS, IdealCard, refused

JOG = 50.0
"""Counts/ms."""

LATE = JOG * BLOCK * CYCLE_MS
"""How far a jog goes until the background has looked."""

RAMP = JOG**2 / 2
"""And until it rests, at Ix15 = 1 count/ms2."""


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def dialect(request: pytest.FixtureRequest) -> Dialect:
    chosen: Dialect = request.param
    return chosen


@pytest.fixture
def card(dialect: Dialect) -> IdealCard:
    return IdealCard(dialect, I113=2000, I114=-1000)


@pytest.mark.parametrize(("direction", "limit"), [(1, 2000), (-1, -1000)])
def test_a_jog_beyond_ix13_or_ix14_ramps_down_at_ix15(card: IdealCard, direction: int, limit: float) -> None:
    motor = card.motor()
    motor.jog_speed(direction)
    card.settle()
    beyond = direction * (card.x - limit)
    assert RAMP - 0.5 * JOG <= beyond <= RAMP + LATE + JOG
    assert (motor.travel.positive, motor.travel.negative) == (direction > 0, direction < 0)
    assert motor.travel.stopped
    assert motor.enabled, "it is held where it stands"


def test_there_is_no_way_further_out_and_the_way_back_is_free(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_speed(1)
    card.settle()
    there = card.x
    outwards: tuple[Callable[[], None], ...] = (
        lambda: motor.jog_speed(1),
        lambda: motor.jog_to(there + 100),
        lambda: motor.jog_by(1.0),
    )
    for jog in outwards:
        jog()
        card.wait(50)
        assert card.x == there
        assert motor.travel.stopped
    motor.jog_to(1500)
    assert not motor.travel.stopped
    card.settle()
    assert card.x == 1500
    assert not motor.travel.positive


def test_zero_is_no_limit(dialect: Dialect) -> None:
    card = IdealCard(dialect, I113=0, I114=0)
    card.motor().jog_to(1e6)
    card.wait(500)
    assert card.motor().velocity == pytest.approx(JOG)
    assert not card.motor().travel.positive


@pytest.mark.parametrize(("off", "direction"), [("I113", 1), ("I114", -1)])
def test_zero_switches_one_limit_off_and_not_the_other(card: IdealCard, off: str, direction: int) -> None:
    card.set(**{off: 0.0})
    card.motor().jog_to(direction * 1e4)
    card.settle()
    assert card.x == direction * 1e4
    card.motor().jog_to(-direction * 1e4)
    card.settle()
    assert card.motor().travel.stopped
    assert -direction * card.x < 5000


def test_one_count_is_a_limit(card: IdealCard) -> None:
    """What clients write where they mean 0."""
    card.set(I113=1.0)
    card.motor().jog_speed(1)
    card.settle()
    assert card.motor().travel.positive
    assert 1 < card.x < 1 + RAMP + LATE, "stopped while it gathered speed"


def test_a_program_is_aborted_with_all_of_its_motors(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM200", "X2000 Y1000", "X2000 Y1000", "P1=1", "X2000 Y1000")
    card.system.run()
    card.settle()
    assert not card.system.running
    # 10 counts/ms ramp down in 50 counts, 5 in 12.5: each motor by itself, and no longer on the path.
    assert 2050 <= card.x <= 2050 + 10 * (BLOCK + 1) * CYCLE_MS
    assert card.motor(2).desired < card.x / 2
    assert card.motor(1).travel.stopped
    assert not card.motor(2).travel.stopped
    assert all(card.motor(number).enabled for number in (1, 2))


def test_a_program_may_begin_beyond_a_limit_and_go_back(card: IdealCard) -> None:
    card.motor().jog_speed(1)
    card.settle()
    card.program("ABS", "TA20 TS0 TM200", "X0")
    card.system.run()
    card.settle()
    assert card.x == 0


def test_a_program_that_goes_further_out_is_stopped_at_once(card: IdealCard) -> None:
    card.motor().jog_speed(1)
    card.settle()
    there = card.x
    card.program("INC", "TA20 TS0 TM200", "X1000")
    card.system.run()
    card.settle()
    assert card.x - there < 10 * BLOCK * CYCLE_MS
    assert card.motor().travel.stopped


def test_they_mean_nothing_until_the_home_trigger_is_found(dialect: Dialect) -> None:
    """The trigger is 500 counts behind the motor, and Ix14 at 300 (Software Reference, Ix13)."""
    card = IdealCard(dialect, I113=2000, I114=-300, I123=-5)
    card.motor().home()
    card.settle()
    assert card.motor().home_complete
    assert card.motor().axis.origin == pytest.approx(0)
    card.motor().jog_speed(-1)
    card.settle()
    assert card.motor().travel.negative, "then they count from the new zero"
    assert card.x == pytest.approx(-300 - RAMP, abs=LATE + JOG)


def test_they_stay_where_they_are_when_an_axis_is_redefined(card: IdealCard) -> None:
    card.system.set_axis("X", 5000)
    card.motor().jog_speed(1)
    card.settle()
    assert card.x == pytest.approx(2000 + RAMP, abs=LATE + JOG)
    assert card.motor().position == pytest.approx(card.x + 5000, abs=0.5)


@pytest.mark.parametrize(("pin", "direction"), [("minus_pin", 1), ("plus_pin", -1)])
def test_the_switch_stops_the_direction_that_its_name_does_not_say(
    card: IdealCard, pin: str, direction: int
) -> None:
    """+LIM stops negative travel, -LIM positive travel (Software Reference, Ix25)."""
    motor = card.motor()
    motor.jog_by(-direction * 100.0)
    card.settle()
    motor.jog_by(direction * 400.0)
    card.wait(5)
    setattr(motor.travel, pin, True)
    card.settle()
    assert (motor.travel.positive, motor.travel.negative) == (direction > 0, direction < 0)
    assert motor.travel.stopped
    there = card.x
    motor.jog_speed(direction)
    card.wait(50)
    assert card.x == there
    motor.jog_by(-direction * 50.0)
    card.settle()
    assert card.x == pytest.approx(there - direction * 50)


def test_bit_17_of_the_flag_mode_takes_the_switches_away_but_not_ix13(card: IdealCard, dialect: Dialect) -> None:
    card.set(**{f"I{dialect.index(Setting.FLAG_MODE, 1)}": 0x20000})
    card.motor().travel.minus_pin = True
    card.motor().jog_to(1000)
    card.settle()
    assert card.x == 1000
    assert not card.motor().travel.positive
    card.motor().jog_speed(1)
    card.settle()
    assert card.motor().travel.positive


def test_010_both_limits_set_for_a_motor_of_the_system(card: IdealCard) -> None:
    card.program("X10")
    card.motor(2).travel.plus_pin = card.motor(2).travel.minus_pin = True
    card.wait(10)
    assert refused(card.system.run) == 10
    card.motor(2).travel.plus_pin = False
    card.wait(10)
    card.system.run()


def test_a_home_search_ends_on_a_switch(dialect: Dialect) -> None:
    card = IdealCard(dialect, I123=-5)
    card.motor().home()
    card.wait(50)
    card.motor().travel.plus_pin = True
    card.settle()
    assert not card.motor().home_complete
    assert card.motor().travel.stopped


def test_a_killed_motor_is_not_looked_at(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_speed(1)
    card.settle()
    motor.kill()
    card.motor().travel.plus_pin = True
    card.wait(10)
    assert motor.travel.positive
    assert not motor.travel.negative
    motor.jog_speed(0)
    assert motor.travel.negative


def test_an_open_loop_output_ends_at_the_limit(card: IdealCard) -> None:
    motor = card.motor()
    motor.open_loop(10)
    card.wait(2000)
    assert motor.travel.positive and motor.travel.stopped
    there = card.x
    card.wait(500)
    assert card.x == pytest.approx(there, abs=1)
    motor.open_loop(5)
    card.wait(100)
    assert card.x == pytest.approx(there, abs=1), "no output that pushes further"
    motor.open_loop(-5)
    card.wait(100)
    assert card.x < there
