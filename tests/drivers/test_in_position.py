"""In position: closed loop, no desired velocity, no program timer, within Ix28, in so many scans."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Setting
from tests.drivers.ideal_card import IdealCard


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(request: pytest.FixtureRequest) -> IdealCard:
    return IdealCard(request.param)


def set_looks(card: IdealCard, looks: int) -> None:
    card.set(**{f"I{card.controller.dialect.index(Setting.IN_POSITION_LOOKS, 1)}": float(looks)})


@pytest.mark.parametrize("looks", [0, 1, 4])
def test_it_takes_one_scan_more_than_is_asked_for(card: IdealCard, looks: int) -> None:
    """I7 + 1 scans, on a Turbo Ixx88 + 1."""
    set_looks(card, looks)
    card.motor().jog_to(100)
    while card.motor().jogging:
        card.block()
        assert not card.motor().in_position or not card.motor().jogging
    # The block in which the jog ended was looked at, too.
    for _ in range(looks):
        assert not card.motor().in_position
        card.block()
    assert card.motor().in_position


def test_the_scans_have_to_be_consecutive(card: IdealCard) -> None:
    set_looks(card, 3)
    card.wait(50)
    assert card.motor().in_position
    card.motor().desired += 11
    card.controller.background()
    card.motor().desired -= 11
    assert not card.motor().in_position
    card.block()
    assert not card.motor().in_position
    card.wait(25)
    assert card.motor().in_position


def test_the_band_is_in_sixteenths_of_a_count(card: IdealCard) -> None:
    """160, the factory's, is 10 counts; the error has to be below."""
    card.motor().desired += 9.9
    assert card.motor().in_position
    card.motor().desired += 0.1
    assert not card.motor().in_position


def test_a_new_jog_ends_it_at_once(card: IdealCard) -> None:
    assert card.motor().in_position
    card.motor().jog_to(100)
    assert not card.motor().in_position


def test_not_in_open_loop(card: IdealCard) -> None:
    card.motor().open_loop(0)
    card.wait(20)
    assert not card.motor().in_position
    card.motor().kill()
    card.wait(20)
    assert not card.motor().in_position


@pytest.mark.parametrize("wait", ["DWELL500", "DELAY500"])
def test_not_while_the_program_timer_runs_even_at_rest(card: IdealCard, wait: str) -> None:
    card.program("INC", "TA20 TS0 TM100", "X100", wait)
    card.system.run()
    card.wait(300)
    assert card.motor().velocity == 0
    assert not card.motor().in_position
    assert not card.motor(2).in_position, "nor a motor that does not move"
    card.settle()
    assert card.motor().in_position


def test_not_while_the_time_base_is_at_zero(card: IdealCard) -> None:
    card.program("INC", "TA20 TS0 TM500", "X1000")
    card.system.run()
    card.wait(100)
    card.system.set_override(0)
    card.wait(50)
    assert card.motor().velocity == 0
    assert not card.motor().in_position
