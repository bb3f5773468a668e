"""The very bytes that programs of others send, and what they take for an answer."""

from __future__ import annotations

import re

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=["pmac", "turbo"])
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/")
    made.sim.wait(0.1)
    return made


def test_a_library_that_connects_with_one_line_needs_a_version_and_one_acknowledgement(card: Wire) -> None:
    card.raw("I3=1 I6=3\r")
    assert re.fullmatch(rb"^\d+\.\d+\s*\r\x06$", card.raw("i6=1 i3=2 ver\r"))


def test_a_library_that_ends_lines_with_cr_and_lf(card: Wire) -> None:
    assert card.raw("P1=5\r\n") == b"\x06"
    assert card.raw("P1 P2\r\n") == b"5\r0\r\x06"
    assert re.fullmatch(rb".*\x07(ERR\d{3})\r", card.raw("UUU\r\n"))
    assert card.raw("\r\n") == b"\x06"


def test_the_poll_of_a_control_panel_answers_a_line_for_each_item_and_ends_with_p99(card: Wire) -> None:
    card.tell("M190=3", "P99=0")
    lines = card.ask("i65???&1??%#1?PVFm190p99")
    assert len(lines) == 10
    assert lines[0] == "0"
    assert [len(line) for line in lines[1:3]] == [12, {8: 12, 32: 18}[len(card.card.motors)]]
    assert lines[3] == "100"
    assert len(lines[4]) == 12
    assert lines[5:] == ["0", "0", "0", "3", "0"]


def test_a_poll_of_eight_axes_in_one_line(card: Wire) -> None:
    line = "i65???&1??%" + "".join(f"#{n}?PVFm{n}90" for n in range(1, 9)) + "p99"
    lines = card.ask(line)
    assert len(lines) == 4 + 8 * 5 + 1
    assert lines[-1] == "0"


def test_an_empty_line_is_a_test_of_the_connection(card: Wire) -> None:
    assert card.raw("\r") == b"\x06"


def test_forty_items_with_spaces_are_forty_lines(card: Wire) -> None:
    items = [f"{item}" for n in range(1, 9) for item in (f"#{n}?", f"#{n}P", f"#{n}F", f"M{n}31", f"P{n}00")]
    assert len(items) == 40
    assert len(card.ask(" ".join(items))) == 40


def test_flags_are_switched_with_expressions(card: Wire) -> None:
    card.tell("I9=0", "i124=0", "i124=i124|$20000")
    assert card.ask("I124") == [str(0x20000)]
    card.tell("i124=i124&$FDFFFF")
    assert card.ask("I124") == ["0"]


def test_a_driver_that_moves_with_jogs_by_its_own_settings(machine: MachineProfile) -> None:
    card = wire(machine, TURBO)
    assert card.raw("I3=2\rI4=0\r") == b"\x06\x06"
    assert len(card.ask("VERSION TYPE DATE")) == 3
    card.tell("M261->D:$000108", "M262->D:$00010B", "I219=1000 I221=0", "I222=10.5", "#2J/", "#2J:1000")
    card.settle()
    assert card.ask("#2P M262 M261") == ["1000", str(1000 * 3072), str(1000 * 3072)]
    assert card.ask("I222") == ["10.5"]


def test_a_driver_that_moves_with_programs(card: Wire) -> None:
    card.tell(
        "CLOSE", "DELETE GATHER", "OPEN PROG 10 CLEAR", "LINEAR ABS TA10 TS0 TM(Q70)", "X(Q71) Z(Q73)", "CLOSE"
    )
    card.tell("&1", "Q70=200 Q71=30 Q73=-20")
    card.tell("&1B10R")
    card.settle()
    assert card.ask("#3P") == ["-20"]
    assert card.ask("&1Q71") == ["30"]
    card.tell("&1A")


def test_blocks_of_variables_by_start_count_and_step(card: Wire) -> None:
    assert card.ask("Q53,6,1") == ["0"] * 6


def test_a_client_that_meets_an_open_buffer_closes_it_and_goes_on(card: Wire) -> None:
    other = Wire(sim=card.sim, port=card.sim.connect())
    other.tell("OPEN PROG 1 CLEAR")
    assert len(card.ask("i65???&1??%#1?PVFm190p99")) == 10
    other.tell("X10")
    card.tell("CLOSE")
    assert other.refusal("X20") == 5


def test_save_is_acknowledged(card: Wire) -> None:
    assert card.raw("SAVE\r") == b"\x06"


def test_after_a_reset_a_client_flushes_and_sets_the_link_up_again(card: Wire) -> None:
    card.raw("$$$***\r")
    card.raw("\x18I4=0\r")
    assert re.fullmatch(rb"^\d+\.\d+\s*\r\x06$", card.raw("i6=1 i3=2 ver\r"))
