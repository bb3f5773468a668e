"""Faults of a motor: whom they kill, by Ix25 or Ixx24, and how they end; and what is closed at power-up."""

from __future__ import annotations

import pytest

from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import PMAC, TURBO, Setting
from drivers.simulator.card.coordinate import CoordinateSystem
from tests.drivers.ideal_card import IdealCard, said

ALL, SYSTEM, ITSELF, ITSELF_TOO = 0, 1 << 21, 1 << 22, 3 << 21


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(request: pytest.FixtureRequest) -> IdealCard:
    """Motors 1 and 2 in system 1, motor 3 in system 2, all in closed loop."""
    made = IdealCard(request.param, I300=1)
    made.controller.define_axis(2, 3, read_definitions(["#3->X"])[0])
    made.motor(3).jog_speed(0)
    made.wait(10)
    return made


def set_mode(card: IdealCard, mode: int) -> None:
    card.set(**{f"I{card.controller.dialect.index(Setting.FLAG_MODE, 1)}": float(mode)})


def closed(card: IdealCard) -> list[int]:
    return [number for number in (1, 2, 3) if card.motor(number).enabled]


def too_far_behind(card: IdealCard) -> None:
    card.motor().desired += 2001.0
    card.controller.background()


def amplifier_off(card: IdealCard) -> None:
    card.motor().fault_input = True
    card.controller.background()


MODES = [(ALL, []), (SYSTEM, [3]), (ITSELF, [2, 3]), (ITSELF_TOO, [2, 3])]


@pytest.mark.parametrize(("mode", "left"), MODES)
@pytest.mark.parametrize("fail", [too_far_behind, amplifier_off])
def test_bits_21_and_22_say_whom_a_fault_kills(card: IdealCard, fail: object, mode: int, left: list[int]) -> None:
    set_mode(card, mode)
    assert callable(fail)
    fail(card)
    assert closed(card) == left
    motor = card.motor()
    assert (motor.fatal_error, motor.amplifier_fault) == (fail is too_far_behind, fail is amplifier_off)
    assert not card.motor(2).fatal_error


def test_a_fault_that_kills_all_motors_ends_every_program(card: IdealCard) -> None:
    set_mode(card, ALL)
    card.program("INC", "TA20 TS0 TM1000", "X1000")
    card.controller.systems[2].point(1)
    card.controller.each_system(CoordinateSystem.run)
    card.wait(100)
    amplifier_off(card)
    assert not any(system.running or system.moving for system in card.controller.systems.values())


def test_the_program_of_the_motor_ends_and_others_go_on(card: IdealCard) -> None:
    set_mode(card, ITSELF)
    card.program("INC", "TA20 TS0 TM1000", "X1000 Y1000")
    card.controller.systems[2].point(1)
    card.controller.each_system(CoordinateSystem.run)
    card.wait(100)
    amplifier_off(card)
    assert not card.system.moving
    assert card.controller.systems[2].moving
    card.settle()
    assert card.motor(2).enabled
    assert card.motor(2).velocity == 0


@pytest.mark.parametrize("number", [11, 12])
def test_zero_switches_a_following_error_limit_off(card: IdealCard, number: int) -> None:
    card.set(**{f"I1{number}": 0.0, "I111" if number == 12 else "I112": 1e9})
    card.motor().desired += 1e6
    card.controller.background()
    assert card.motor().enabled
    assert not card.motor().warning


def test_the_warning_comes_at_ix12_and_stays_after_a_trip(card: IdealCard) -> None:
    set_mode(card, ITSELF)
    motor = card.motor()
    motor.desired += 1000.0
    assert said(motor, "warning") == [], "16000 sixteenths are 1000 counts"
    motor.desired += 1.0
    assert said(motor, "warning")
    too_far_behind(card)
    assert said(motor, "warning", "fatal_error") == ["warning", "fatal_error"]
    motor.jog_speed(0)
    assert said(motor, "warning", "fatal_error") == []


def test_an_amplifier_that_still_complains_is_switched_off_again(card: IdealCard) -> None:
    amplifier_off(card)
    card.motor().jog_speed(0)
    assert not card.motor().amplifier_fault
    card.wait(10)
    assert not card.motor().enabled
    assert card.motor().amplifier_fault
    card.motor().fault_input = False
    card.motor().jog_speed(0)
    card.wait(10)
    assert card.motor().enabled


def test_bit_20_ignores_the_amplifier(card: IdealCard) -> None:
    set_mode(card, 1 << 20)
    amplifier_off(card)
    assert closed(card) == [1, 2, 3]


def test_a_program_does_not_outlive_the_activation_of_its_motors(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM1000", "X1000 Y1000")
    card.system.run()
    card.wait(100)
    card.set(I200=0)
    card.settle()
    assert not card.system.running
    assert closed(card) == [1, 3]
    assert card.x < 300


def test_what_is_no_longer_activated_is_off(card: IdealCard) -> None:
    card.motor().jog_speed(1)
    card.wait(50)
    card.set(I100=0)
    card.wait(10)
    assert not card.motor().enabled
    assert closed(card) == [2, 3]


@pytest.mark.parametrize(("power_up", "expected"), [(0, []), (1, [1]), (2, []), (3, [1])])
def test_bit_0_of_ix80_closes_the_loop_at_power_up(power_up: int, expected: list[int]) -> None:
    card = IdealCard(I180=power_up)
    card.controller.reset()
    assert closed(card) == expected


def test_a_reset_starts_from_nothing(card: IdealCard) -> None:
    card.run("TA20 TS0 TM100", "X1000", "PSET X5")
    card.motor().home_zero()
    card.system.set_override(50)
    card.controller.reset()
    motor = card.motor()
    assert (motor.position, motor.home_complete, motor.home_capture) == (0, False, 0)
    assert card.system.time_base.percent == 100
    assert card.system.program_number is None
