"""The jogs that end somewhere, the triggers, HMZ, open-loop outputs, `$` and `$*`."""

from __future__ import annotations

import math

import pytest

from drivers.pmac.dialect import PMAC, TURBO
from drivers.simulator.card.jog_motion import Stage
from tests.drivers.conftest import Bench
from tests.drivers.ideal_card import BLOCK, CYCLE_MS, IdealCard, refused, said


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(request: pytest.FixtureRequest) -> IdealCard:
    return IdealCard(request.param)


def jogged(card: IdealCard) -> float:
    card.settle()
    return card.x


def test_j_equals_is_a_position(card: IdealCard) -> None:
    card.motor().jog_to(300)
    assert jogged(card) == 300
    card.motor().jog_to(-40.5)
    assert jogged(card) == -40.5


def test_j_colon_is_relative_to_the_commanded_and_j_caret_to_the_actual_position(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_to(0.4)
    card.settle()
    motor.jog_by(100.0)
    assert jogged(card) == pytest.approx(100.4)
    assert motor.encoder == 100
    motor.jog_by(100.0, from_actual=True)
    assert jogged(card) == 200, "from what the encoder says, not from 100.4"


def test_a_jog_by_a_distance_closes_an_open_loop(card: IdealCard) -> None:
    card.motor().kill()
    card.motor().jog_by(25.0)
    assert jogged(card) == 25


def test_a_jog_by_nothing_closes_an_open_loop_and_moves_nothing(card: IdealCard) -> None:
    """`J:0`, as clients send it."""
    card.motor().jog_to(100)
    card.settle()
    card.motor().kill()
    card.motor().jog_by(0.0)
    assert card.motor().enabled
    assert jogged(card) == 100


def test_j_equals_alone_goes_back_to_before_the_jog(card: IdealCard) -> None:
    card.motor().jog_to(500)
    card.settle()
    card.motor().jog_speed(1)
    card.wait(100)
    card.motor().jog_speed(0)
    card.settle()
    card.motor().jog_back()
    assert jogged(card) == 500


def test_a_jog_until_a_trigger_ends_so_many_counts_past_it(card: IdealCard) -> None:
    """The next trigger is 1500 counts ahead; it moves no zero."""
    motor = card.motor()
    motor.jog_to(5000, past_trigger=-20.0)
    card.wait(10)
    assert (motor.jog.stage, motor.jog.homes, motor.home_complete) == (Stage.SEARCHING, False, False)
    assert jogged(card) == pytest.approx(1500 - 20)
    assert (motor.jog.stage, motor.home_complete) == (None, False)


def test_without_a_trigger_it_ends_where_it_was_told_and_the_bit_stays(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_to(1000, past_trigger=0.0)
    assert jogged(card) == 1000
    assert motor.jog.stage not in (None, Stage.SEARCHING)
    motor.jog_by(1.0)
    assert motor.jog.stage is None


def test_the_search_bit_ends_with_the_trigger_and_home_complete_comes_with_it(card: IdealCard) -> None:
    card.set(I123=-5)
    motor = card.motor()
    motor.home()
    while motor.jog.stage is Stage.SEARCHING:
        assert not motor.home_complete
        card.block()
    assert motor.home_complete
    assert motor.jogging, "it still comes to rest"
    card.settle()
    assert card.x == 0


@pytest.mark.parametrize("offset", [0.0, 160.0, -160.0])
def test_a_home_search_ends_at_zero_which_is_ix26_from_the_trigger(card: IdealCard, offset: float) -> None:
    """In sixteenths of a count; the trigger is 500 counts behind the place of power-up."""
    card.set(I123=-5, I126=offset)
    card.motor().home()
    card.settle()
    motor = card.motor()
    assert (card.x, motor.position) == (0, 0)
    assert motor.axis.origin == pytest.approx(offset / 16)
    assert motor.home_capture == pytest.approx(-500), "counted from power-up"


def test_hmz_declares_the_place_home_without_a_move(card: IdealCard) -> None:
    motor = card.motor()
    motor.jog_to(321)
    card.settle()
    motor.home_zero()
    assert motor.home_complete
    assert motor.position == 0
    assert motor.home_capture == 321
    card.wait(50)
    assert card.x == 0
    assert motor.enabled
    assert motor.axis.origin == 500 + 321


def test_a_home_moves_the_place_that_j_equals_leads_back_to_with_the_zero(card: IdealCard) -> None:
    """J= alone goes back to a place of the iron, whatever it is called now."""
    motor = card.motor()
    motor.jog_to(5000)
    card.settle()
    motor.home_zero()
    motor.jog_back()
    card.settle()
    assert motor.axis.origin + card.x == 500, "where the motor stood before the jog"


def test_a_program_goes_on_from_where_the_motor_is_when_its_zero_has_moved(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM100", "X1000", "X1000", "X1000")
    card.system.run()
    card.wait(50)
    card.system.quit()
    card.settle()
    assert card.x == 2000
    card.motor().home_zero()
    seen = len(card.track[1])
    card.system.run()
    card.settle()
    assert card.x == 1000, "the last distance, from the new zero"
    assert all(0 <= place <= 1000 for place in card.track[1][seen:])


def test_hmz_leaves_a_killed_motor_killed(card: IdealCard) -> None:
    card.motor().kill()
    card.motor().home_zero()
    assert card.motor().home_complete
    assert not card.motor().enabled


def test_o_opens_the_loop_with_the_amplifier_on(card: IdealCard) -> None:
    motor = card.motor()
    motor.open_loop(0)
    card.wait(20)
    names = ("enabled", "amplifier_enabled")
    assert said(motor, *names) == ["amplifier_enabled"]
    assert motor.following_error == 0
    assert card.x == 0
    motor.jog_speed(0)
    assert said(motor, *names) == ["enabled", "amplifier_enabled"]
    motor.kill()
    assert said(motor, *names) == []


@pytest.mark.parametrize(("percent", "effective"), [(50, 50), (-25, -25), (130, 100), (-999, -100)])
def test_an_output_is_a_share_of_ix69_and_saturates(card: IdealCard, percent: float, effective: float) -> None:
    """An ideal motor goes to 100 counts/ms at full output."""
    card.motor().open_loop(percent)
    card.wait(2000)
    assert card.motor().encoder_step == pytest.approx(effective * CYCLE_MS, abs=1)
    card.motor().open_loop(0)
    card.wait(3000)
    assert card.motor().encoder_step == 0


def test_phasing_closes_the_loop_and_is_refused_in_motion(card: IdealCard) -> None:
    card.motor().kill()
    card.motor().phase()
    assert card.motor().enabled
    card.motor().jog_speed(1)
    card.wait(20)
    assert refused(card.motor().phase) == 18


def test_001_an_absolute_position_is_not_read_while_a_program_is_held(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM500", "X1000", "X1000")
    card.system.run()
    card.wait(100)
    card.system.hold()
    card.wait(50)
    assert card.system.motion.held_at is not None
    assert refused(lambda: card.controller.read_absolute_position(1)) == 1
    card.system.run()
    card.settle()
    assert card.x == 2000
    assert not card.system.moving


def test_reading_an_absolute_position_kills_and_forgets_home(card: IdealCard) -> None:
    card.motor().jog_to(100)
    card.settle()
    card.motor().home_zero()
    card.system.set_axis("X", 50)
    card.controller.read_absolute_position(1)
    motor = card.motor()
    assert (motor.enabled, motor.home_complete, motor.position) == (False, False, 0)
    assert card.system.frame.positions()["X"] == 0


def test_a_pushed_slide_is_newtons_law(closed: Bench) -> None:
    """10 % of Ix69: 1053.1 bits of 10 V / 32768, 11.45 A/V, 54.5 N/A on 4.74 kg with 201.6 N s/m."""
    newton = 0.1 * 10_531 * 10 / 32_768 * 11.45 * 54.5
    closed.client.request("I113=0 #1O10")
    start = closed.sim.controller.now_ms
    closed.sim.wait(0.1)
    motor = closed.sim.controller.motors[1]
    for _ in range(3):
        seconds = (closed.sim.controller.now_ms - start) / 1000
        speed_um_s = newton / 201.6 * (1 - math.exp(-201.6 / 4.74 * seconds)) * 1e6
        # The output reaches the amplifier one cycle late, and the encoder counts 0.2 um.
        assert motor.encoder_step * 0.2 == pytest.approx(speed_um_s * CYCLE_MS / 1000, rel=0.01, abs=0.3)
        closed.sim.wait(BLOCK * CYCLE_MS / 1000)
