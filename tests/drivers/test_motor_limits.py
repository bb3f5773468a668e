"""What ends a motion by itself: travel limits, faults; and what is in position."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import PMAC, TURBO, Dialect, FamilySetting
from drivers.simulator.card.coordinate import CoordinateSystem
from tests.drivers.wire_card import BLOCK, CYCLE_MS, IdealCard, refused, said

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
def test_the_switch_stops_the_direction_of_the_other_name(card: IdealCard, pin: str, direction: int) -> None:
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
    card.set(**{f"I{dialect.index(FamilySetting.FLAG_MODE, 1)}": 0x20000})
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


# Faults of a motor: whom they kill, by Ix25 or Ixx24, and how they end; and what is closed at power-up.

ALL, SYSTEM, ITSELF, ITSELF_TOO = 0, 1 << 21, 1 << 22, 3 << 21


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def faults_card(request: pytest.FixtureRequest) -> IdealCard:
    """Motors 1 and 2 in system 1, motor 3 in system 2, all in closed loop."""
    made = IdealCard(request.param, I300=1)
    made.controller.define_axis(2, 3, read_definitions(["#3->X"])[0])
    made.motor(3).jog_speed(0)
    made.wait(10)
    return made


def set_mode(faults_card: IdealCard, mode: int) -> None:
    faults_card.set(**{f"I{faults_card.controller.dialect.index(FamilySetting.FLAG_MODE, 1)}": float(mode)})


def closed(faults_card: IdealCard) -> list[int]:
    return [number for number in (1, 2, 3) if faults_card.motor(number).enabled]


def too_far_behind(faults_card: IdealCard) -> None:
    faults_card.motor().desired += 2001.0
    faults_card.controller.background()


def amplifier_off(faults_card: IdealCard) -> None:
    faults_card.motor().fault_input = True
    faults_card.controller.background()


MODES = [(ALL, []), (SYSTEM, [3]), (ITSELF, [2, 3]), (ITSELF_TOO, [2, 3])]


@pytest.mark.parametrize(("mode", "left"), MODES)
@pytest.mark.parametrize("fail", [too_far_behind, amplifier_off])
def test_bits_21_and_22_say_whom_a_fault_kills(
    faults_card: IdealCard, fail: object, mode: int, left: list[int]
) -> None:
    set_mode(faults_card, mode)
    assert callable(fail)
    fail(faults_card)
    assert closed(faults_card) == left
    motor = faults_card.motor()
    assert (motor.fatal_error, motor.amplifier_fault) == (fail is too_far_behind, fail is amplifier_off)
    assert not faults_card.motor(2).fatal_error


def test_a_fault_that_kills_all_motors_ends_every_program(faults_card: IdealCard) -> None:
    set_mode(faults_card, ALL)
    faults_card.program("INC", "TA20 TS0 TM1000", "X1000")
    faults_card.controller.systems[2].point(1)
    faults_card.controller.each_system(CoordinateSystem.run)
    faults_card.wait(100)
    amplifier_off(faults_card)
    assert not any(system.running or system.moving for system in faults_card.controller.systems.values())


def test_the_program_of_the_motor_ends_and_others_go_on(faults_card: IdealCard) -> None:
    set_mode(faults_card, ITSELF)
    faults_card.program("INC", "TA20 TS0 TM1000", "X1000 Y1000")
    faults_card.controller.systems[2].point(1)
    faults_card.controller.each_system(CoordinateSystem.run)
    faults_card.wait(100)
    amplifier_off(faults_card)
    assert not faults_card.system.moving
    assert faults_card.controller.systems[2].moving
    faults_card.settle()
    assert faults_card.motor(2).enabled
    assert faults_card.motor(2).velocity == 0


@pytest.mark.parametrize("number", [11, 12])
def test_zero_switches_a_following_error_limit_off(faults_card: IdealCard, number: int) -> None:
    faults_card.set(**{f"I1{number}": 0.0, "I111" if number == 12 else "I112": 1e9})
    faults_card.motor().desired += 1e6
    faults_card.controller.background()
    assert faults_card.motor().enabled
    assert not faults_card.motor().warning


def test_the_warning_comes_at_ix12_and_stays_after_a_trip(faults_card: IdealCard) -> None:
    set_mode(faults_card, ITSELF)
    motor = faults_card.motor()
    motor.desired += 1000.0
    assert said(motor, "warning") == [], "16000 sixteenths are 1000 counts"
    motor.desired += 1.0
    assert said(motor, "warning")
    too_far_behind(faults_card)
    assert said(motor, "warning", "fatal_error") == ["warning", "fatal_error"]
    motor.jog_speed(0)
    assert said(motor, "warning", "fatal_error") == []


def test_an_amplifier_that_still_complains_is_switched_off_again(faults_card: IdealCard) -> None:
    amplifier_off(faults_card)
    faults_card.motor().jog_speed(0)
    assert not faults_card.motor().amplifier_fault
    faults_card.wait(10)
    assert not faults_card.motor().enabled
    assert faults_card.motor().amplifier_fault
    faults_card.motor().fault_input = False
    faults_card.motor().jog_speed(0)
    faults_card.wait(10)
    assert faults_card.motor().enabled


def test_bit_20_ignores_the_amplifier(faults_card: IdealCard) -> None:
    set_mode(faults_card, 1 << 20)
    amplifier_off(faults_card)
    assert closed(faults_card) == [1, 2, 3]


def test_a_program_does_not_outlive_the_activation_of_its_motors(faults_card: IdealCard) -> None:
    faults_card.program("INC", "TA20 TS0 TM1000", "X1000 Y1000")
    faults_card.system.run()
    faults_card.wait(100)
    faults_card.set(I200=0)
    faults_card.settle()
    assert not faults_card.system.running
    assert closed(faults_card) == [1, 3]
    assert faults_card.x < 300


def test_what_is_no_longer_activated_is_off(faults_card: IdealCard) -> None:
    faults_card.motor().jog_speed(1)
    faults_card.wait(50)
    faults_card.set(I100=0)
    faults_card.wait(10)
    assert not faults_card.motor().enabled
    assert closed(faults_card) == [2, 3]


@pytest.mark.parametrize(("power_up", "expected"), [(0, []), (1, [1]), (2, []), (3, [1])])
def test_bit_0_of_ix80_closes_the_loop_at_power_up(power_up: int, expected: list[int]) -> None:
    faults_card = IdealCard(I180=power_up)
    faults_card.controller.reset()
    assert closed(faults_card) == expected


def test_a_reset_starts_from_nothing(faults_card: IdealCard) -> None:
    faults_card.run("TA20 TS0 TM100", "X1000", "PSET X5")
    faults_card.motor().home_zero()
    faults_card.system.set_override(50)
    faults_card.controller.reset()
    motor = faults_card.motor()
    assert (motor.position, motor.home_complete, motor.home_capture) == (0, False, 0)
    assert faults_card.system.time_base.percent == 100
    assert faults_card.system.program_number is None


# In position: closed loop, no desired velocity, no program timer, within Ix28, in so many scans.


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def position_card(request: pytest.FixtureRequest) -> IdealCard:
    return IdealCard(request.param)


def set_looks(position_card: IdealCard, looks: int) -> None:
    position_card.set(
        **{f"I{position_card.controller.dialect.index(FamilySetting.IN_POSITION_LOOKS, 1)}": float(looks)}
    )


@pytest.mark.parametrize("looks", [0, 1, 4])
def test_it_takes_one_scan_more_than_is_asked_for(position_card: IdealCard, looks: int) -> None:
    """I7 + 1 scans, on a Turbo Ixx88 + 1."""
    set_looks(position_card, looks)
    position_card.motor().jog_to(100)
    while position_card.motor().jogging:
        position_card.block()
        assert not position_card.motor().in_position or not position_card.motor().jogging
    # The block in which the jog ended was looked at, too.
    for _ in range(looks):
        assert not position_card.motor().in_position
        position_card.block()
    assert position_card.motor().in_position


def test_the_scans_have_to_be_consecutive(position_card: IdealCard) -> None:
    set_looks(position_card, 3)
    position_card.wait(50)
    assert position_card.motor().in_position
    position_card.motor().desired += 11
    position_card.controller.background()
    position_card.motor().desired -= 11
    assert not position_card.motor().in_position
    position_card.block()
    assert not position_card.motor().in_position
    position_card.wait(25)
    assert position_card.motor().in_position


def test_the_band_is_in_sixteenths_of_a_count(position_card: IdealCard) -> None:
    """160, the factory's, is 10 counts; the error has to be below."""
    position_card.motor().desired += 9.9
    assert position_card.motor().in_position
    position_card.motor().desired += 0.1
    assert not position_card.motor().in_position


def test_a_new_jog_ends_it_at_once(position_card: IdealCard) -> None:
    assert position_card.motor().in_position
    position_card.motor().jog_to(100)
    assert not position_card.motor().in_position


def test_not_in_open_loop(position_card: IdealCard) -> None:
    position_card.motor().open_loop(0)
    position_card.wait(20)
    assert not position_card.motor().in_position
    position_card.motor().kill()
    position_card.wait(20)
    assert not position_card.motor().in_position


@pytest.mark.parametrize("wait", ["DWELL500", "DELAY500"])
def test_not_while_the_program_timer_runs_even_at_rest(position_card: IdealCard, wait: str) -> None:
    position_card.program("INC", "TA20 TS0 TM100", "X100", wait)
    position_card.system.run()
    position_card.wait(300)
    assert position_card.motor().velocity == 0
    assert not position_card.motor().in_position
    assert not position_card.motor(2).in_position, "nor a motor that does not move"
    position_card.settle()
    assert position_card.motor().in_position


def test_not_while_the_time_base_is_at_zero(position_card: IdealCard) -> None:
    position_card.program("INC", "TA20 TS0 TM500", "X1000")
    position_card.system.run()
    position_card.wait(100)
    position_card.system.set_override(0)
    position_card.wait(50)
    assert position_card.motor().velocity == 0
    assert not position_card.motor().in_position
