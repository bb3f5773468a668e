"""What `check-program` and a download say of many small programs: the same, and each refusal names its line."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import TURBO
from drivers.pmac.language.errors import PmacError
from drivers.pmac.program_text import RefusedLine, read_program
from profiles.machine import MachineProfile
from tests.drivers.made_programs import MOTION, PLCS, REFUSED_MOTION, REFUSED_PLCS
from tests.drivers.wire_card import Wire, wire

ENDING = "OPEN PROG 2 CLEAR\nCLOSE"
"""A text needs a motion program to be one."""


def text_of(body: str, *, plc: bool) -> str:
    return f"OPEN {'PLC' if plc else 'PROG'} 1 CLEAR\n{body}\nCLOSE\n{ENDING}"


def downloaded(card: Wire, text: str) -> list[int]:
    """Return the places of the lines that the card refuses, from 1."""
    refused = []
    for place, line in enumerate(text.splitlines(), start=1):
        said = card.raw(line + "\r")
        if not said:
            card.sim.wait(0.1)
            said = card.port.take_output()
        if said.startswith(b"\x07"):
            refused.append(place)
    return refused


def checked(text: str) -> list[RefusedLine]:
    refused: list[RefusedLine] = []
    read_program(text, refused)
    return refused


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


def test_there_are_enough_of_them() -> None:
    assert len({*MOTION, *PLCS, *REFUSED_MOTION, *REFUSED_PLCS}) >= 150


def test_programs_in_use_are_taken_by_both(card: Wire) -> None:
    wrong = []
    for body, plc in [*((body, False) for body in MOTION), *((body, True) for body in PLCS)]:
        text = text_of(body, plc=plc)
        said, here = downloaded(card, text), [line.place for line in checked(text)]
        if said or here:
            wrong.append((body, said, here))
    assert wrong == []


def test_what_is_refused_is_refused_by_both_at_the_same_line_and_says_why(card: Wire) -> None:
    wrong = []
    for body, plc in [*((body, False) for body in REFUSED_MOTION), *((body, True) for body in REFUSED_PLCS)]:
        text = text_of(f"P9=1\n{body}\nP9=2", plc=plc)
        said, here = downloaded(card, text), checked(text)
        if said != [3] or [line.place for line in here] != [3] or not here[0].error.detail:
            wrong.append((body, said, here))
    assert wrong == []
    assert card.listed("PLC 1") == ["P9=1", "P9=2"]


@pytest.mark.parametrize("body", MOTION[:40])
def test_what_is_listed_is_the_same_program(card: Wire, body: str) -> None:
    assert downloaded(card, text_of(body, plc=False)) == []
    first = card.ask("LIST PROG 1")
    assert downloaded(card, text_of("\n".join(first), plc=False)) == []
    assert card.ask("LIST PROG 1") == first


def test_a_refusal_without_a_list_names_the_line() -> None:
    with pytest.raises(PmacError, match="line 2"):
        read_program(text_of("X10 bad", plc=False))
