"""The list of error numbers: for each of them what brings it about, in both families (Software Reference, I6)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.card import buffers
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

Prepare = Callable[[Wire], object]


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """All loops closed; coordinate system 1 is addressed."""
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/")
    made.sim.wait(0.1)
    return made


def after(*lines: str, seconds: float = 0.0) -> Prepare:
    def prepare(card: Wire) -> None:
        card.tell(*lines)
        card.sim.wait(seconds)

    return prepare


def program(*lines: str, then: str = "&1B1", seconds: float = 0.0) -> Prepare:
    return after("OPEN PROG 1 CLEAR", *lines, "CLOSE", then, seconds=seconds)


def running(card: Wire) -> None:
    program("INC TA10 TS0 TM100", "WHILE(P1=0)", "X10", "X-10", "ENDWHILE", then="&1B1R", seconds=0.3)(card)


def locked(card: Wire) -> None:
    card.tell("PASSWORD=secret")
    card.raw("$$$\rI3=2 I6=1\r")


def both_limits(card: Wire) -> None:
    program("X1")(card)
    travel = card.card.motors[3].travel
    travel.plus_pin = travel.minus_pin = True
    card.sim.wait(0.1)


def moved_since_the_stop(card: Wire) -> None:
    program("INC TA10 TS0 TM100", "Z30", "Z30", then="&1B1S")(card)
    card.settle()
    card.tell("#3J:5")
    card.settle()


ROWS: dict[str, tuple[int, Prepare, str]] = {
    "001 a jog while a program runs": (1, running, "#1J+"),
    "001 a kill while a program runs": (1, running, "#1K"),
    "001 a second start": (1, running, "R"),
    "001 a buffer while a program runs": (1, running, "OPEN PROG 2"),
    "002 a protected program": (2, locked, "OPEN PROG 1000"),
    "002 the last program": (2, locked, "LIST PROG 32767"),
    "002 another password": (2, locked, "PASSWORD=Secret"),
    "003 no command": (3, after(), "UUU"),
    "003 no such motor": (3, after(), "#33"),
    "003 a motor of another system": (3, after(), "&2#1->X"),
    "003 no such program": (3, after(), "LIST PROG 9"),
    "004 a character above 127": (4, after(), "P1=1\x80"),
    "004 the highest character": (4, after(), "\xff"),
    "005 a move": (5, after(), "X100"),
    "005 CLEAR": (5, after(), "CLEAR"),
    "006 no room": (6, program("X1", "X2", then="OPEN PROG 1"), "X3"),
    "007 a second buffer": (7, after("OPEN PROG 1"), "OPEN PLC 1"),
    "009 ENDIF without IF": (9, program("ENDIF"), "R"),
    "009 ENDWHILE without WHILE": (9, program("ENDWHILE"), "R"),
    "010 both limits": (10, both_limits, "R"),
    "011 the move before": (
        11,
        program("INC TA10 TS0 TM500", "X10", "X10", then="&1B1S", seconds=0.1),
        "S",
    ),
    "012 open loop": (12, program("X1", then="#2K &1B1"), "R"),
    "013 not activated": (13, program("X1", then="I300=0 &1B1"), "R"),
    "013 a jog": (13, after("I300=0"), "#3J+"),
    "014 no motors": (14, program("X1", then="&2B1"), "R"),
    "015 pointing to nothing": (15, after(), "R"),
    "015 pointing to what is not there": (15, after("B7"), "R"),
    "015 not pointed again after OPEN": (15, program("X1", then="&1B1 OPEN PROG 2 CLOSE"), "R"),
    "016 ENDWHILE is missing": (16, program("WHILE(P1=0)", "X1"), "R"),
    "016 ENDIF is missing": (16, program("IF(P1=0)", "X1"), "R"),
    "017 off the stopped position": (17, moved_since_the_stop, "R"),
    "018 phasing in motion": (18, after("#3J+", seconds=0.2), "#3$"),
}


@pytest.mark.parametrize(("number", "prepare", "line"), ROWS.values(), ids=ROWS)
def test_an_error_number_stands_for_one_kind_of_refusal(
    card: Wire, monkeypatch: pytest.MonkeyPatch, number: int, prepare: Prepare, line: str
) -> None:
    """BELL, ERR and three digits, CR, and no acknowledgement."""
    monkeypatch.setattr(buffers, "MAX_LINES", 5)
    if number == 6:
        monkeypatch.setattr(buffers, "MAX_LINES", 2)
    prepare(card)
    assert card.raw(f"{line}\r".encode("latin-1")) == b"\x07ERR%03d\r" % number


def test_what_has_a_number_is_what_the_list_has() -> None:
    """008 (MACRO) and 019 (cutter compensation) have no cause here; 000 and 020 are not in the list."""
    assert {number for number, _, _ in ROWS.values()} == set(range(1, 20)) - {8, 19}


def test_a_password_opens_what_it_protects(card: Wire) -> None:
    locked(card)
    card.tell("OPEN PROG 999", "CLOSE", "PASSWORD=secret", "OPEN PROG 1000", "CLOSE")


def test_a_carriage_return_that_a_bad_line_has_spoilt_is_answered_by_nothing(card: Wire) -> None:
    """With its parity bit set it ends no line: there is nothing to answer until the next one."""
    assert card.raw(b"P1=1\x8d") == b""
    card.sim.wait(1.0)
    assert card.port.take_output() == b""
    assert card.raw(b"\r") == b"\x07ERR004\r"
    assert card.ask("P1") == ["0"]


@pytest.mark.parametrize(
    "word", ["RAPID", "RETURN", "RET", "STOP", "SPLINE1", "ABS", "READ(A)", "PSET X0", "FRAX(X)"]
)
def test_005_a_word_of_programs_is_not_taken_letter_by_letter(card: Wire, word: str) -> None:
    """R alone would run the program, S step it, A abort."""
    card.tell("OPEN PROG 1 CLEAR", "LINEAR INC TA10 TS0 TM1000", "X10", "X-10", "CLOSE", "#1J/#2J/#3J/", "&1B1")
    assert card.raw(f"{word}\r").endswith(b"\x07ERR005\r")
    card.sim.wait(0.1)
    assert not card.card.systems[1].running
    assert all(card.card.motors[motor].enabled for motor in (1, 2, 3))
    card.tell("&1R")
    assert card.raw(f"{word}\r").endswith(b"\x07ERR005\r")
    card.sim.wait(0.1)
    assert card.card.systems[1].running, "and nothing that runs is aborted"
