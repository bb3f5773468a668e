"""Several cards on one line: `@n` with bit 1 of I1 (User Manual, multiple cards)."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Card number 0, on a line of many."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.raw("I1=2\r")
    return made


def test_alone_on_its_line_a_card_is_always_meant(machine: MachineProfile) -> None:
    alone = wire(machine)
    assert alone.ask("@5 P1=1 P1 @") == ["1", "5"]


def test_a_line_without_the_address_of_the_card_is_not_obeyed_and_not_answered(card: Wire) -> None:
    assert card.raw("P1=1\rUUU\r\r@3P1=2\rP1\r") == b""
    assert card.raw("@0P1\r") == b"0\r\x06"


def test_an_address_holds_until_the_next_one(card: Wire) -> None:
    assert card.raw("@0\rP1=4\rP1\r") == b"\x06\x064\r\x06"
    assert card.raw("@1\rP1=5\r") == b"\x06"
    assert card.raw("@0P1 @\r") == b"4\r0\r\x06"


def test_only_what_is_meant_for_this_card_is_done_of_a_line(card: Wire) -> None:
    """Both programs of `@0&1B1R@1&1B7R` start with one CR, each on its card."""
    assert card.raw("@0P1=1@1P1=2 UUU@0P2=3\r") == b"\x06"
    assert card.raw("@0P1..2\r") == b"1\r3\r\x06"


def test_two_signs_mean_every_card(card: Wire) -> None:
    assert card.raw("@@P1=7 P1 @\r") == b"7\r@\r\x06"


def test_the_number_of_the_card_is_i0(card: Wire) -> None:
    card.raw("@0I0=4\r")
    assert card.raw("@0P1=1\r") == b""
    assert card.raw("@4P1\r") == b"0\r\x06"


def test_control_characters_without_an_answer_act_on_every_card_and_the_others_on_the_one_that_is_meant(
    card: Wire,
) -> None:
    card.raw("@0#2J/\r")
    card.raw("@1\r")
    assert card.raw("\x02\x03\x06\x07\x10\x16\x0b") == b""
    assert not card.card.motors[2].enabled
    assert card.raw("@0\r") == b"\x06"
    assert card.raw("\x07") == b"000001000000\r"


def test_003_a_number_that_no_card_can_have(card: Wire) -> None:
    assert card.raw("@16\r") == b"\x07ERR003\r"
