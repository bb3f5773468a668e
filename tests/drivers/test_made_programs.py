"""What `check-program` and a download say of many small programs: the same, and each refusal names its line."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import partial

import pytest

from drivers.pmac.analysis.findings import Code
from drivers.pmac.analysis.program import check_program
from drivers.pmac.dialect import TURBO
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import unary_functions
from drivers.pmac.language.parser import WORDS
from drivers.pmac.language.plc_statements import PLC_WORDS
from drivers.pmac.program_text import RefusedLine, read_program
from drivers.simulator.commands.line import read_line
from profiles.machine import MachineProfile
from tests.drivers.families import of_family
from tests.drivers.made_programs import (
    KINEMATIC,
    MOTION,
    ON_LINE,
    PLCS,
    PREPROCESSED,
    REFUSED_KINEMATIC,
    REFUSED_MOTION,
    REFUSED_ON_LINE,
    REFUSED_PLCS,
)
from tests.drivers.wire_card import Wire, wire

ENDING = "OPEN PROG 2 CLEAR\nCLOSE"
"""A text needs a motion program to be one."""


LINES = (Code.LINE_REFUSED, Code.WORD_ABSENT)
"""What the checker says of a line that it cannot take."""


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
    read_program(text, refused, on_line=partial(read_line, dialect=TURBO))
    return refused


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


def test_there_are_enough_of_them() -> None:
    assert len({*MOTION, *PLCS, *REFUSED_MOTION, *REFUSED_PLCS}) >= 150


def without_blanks(bodies: Iterable[str]) -> str:
    return re.sub(r"[ \t]", "", "\n".join(bodies)).upper()


def test_every_word_of_the_language_is_in_one_of_them() -> None:
    motion, plcs = without_blanks(MOTION), without_blanks(PLCS)
    functions = (*unary_functions(degrees=True), "ATAN2")
    assert [word for word in (*WORDS, *functions) if word not in motion] == []
    assert [word for word in PLC_WORDS if word not in plcs] == []
    comparators = ("=", "!=", ">", "!>", "<", "!<", "~", "!~")
    assert [word for word in (*comparators, *"+-*/%&|^") if word not in motion] == []


def test_kinematic_programs_are_taken_or_refused_by_both(card: Wire) -> None:
    for kind in ("INVERSE", "FORWARD"):
        for body in KINEMATIC:
            text = f"OPEN {kind} CLEAR\n{body}\nCLOSE\n{ENDING}"
            assert (downloaded(card, text), checked(text)) == ([], []), body
        for body in REFUSED_KINEMATIC:
            text = f"OPEN {kind} CLEAR\nP9=1\n{body}\nCLOSE\n{ENDING}"
            here = checked(text)
            assert (downloaded(card, text), [line.place for line in here]) == ([3], [3]), body
            assert here[0].error.detail


@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_the_checker_walks_all_of_them_and_says_why_it_does_not(machine: MachineProfile, family: str) -> None:
    lathe = of_family(machine, family)
    for body in (*MOTION, *REFUSED_MOTION):
        try:
            found = check_program(text_of(body, plc=False), lathe)
        except PmacError as refused:
            assert refused.detail, body
            continue
        refusals = [each for each in found.findings if each.code in (*LINES, Code.RUN_TIME_ERROR)]
        assert all(each.lines and each.values["error"] for each in refusals), body
        if body in REFUSED_MOTION:
            assert [each.lines for each in refusals if each.code in (Code.LINE_REFUSED, Code.WORD_ABSENT)] == [
                (2,)
            ], body


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


def test_lines_outside_of_the_buffers_are_taken_or_refused_by_both(card: Wire) -> None:
    wrong = []
    for line in (*ON_LINE, *REFUSED_ON_LINE):
        text = f"{line}\nP9=2\n{ENDING}"
        said, here = downloaded(card, text), checked(text)
        expected = [1] if line in REFUSED_ON_LINE else []
        if (said, [each.place for each in here]) != (expected, expected):
            wrong.append((line, said, here))
    assert wrong == []


@pytest.mark.parametrize("text", PREPROCESSED)
def test_what_is_sent_of_a_preprocessed_text_is_taken(card: Wire, text: str) -> None:
    assert checked(text) == []
    sent = read_program(text).lines
    assert not any(line.startswith("#define") for line in sent)
    assert downloaded(card, "\n".join(sent)) == []


@pytest.mark.parametrize("body", MOTION[:40])
def test_what_is_listed_is_the_same_program(card: Wire, body: str) -> None:
    assert downloaded(card, text_of(body, plc=False)) == []
    first = card.ask("LIST PROG 1")
    assert downloaded(card, text_of("\n".join(first), plc=False)) == []
    assert card.ask("LIST PROG 1") == first


def test_a_refusal_without_a_list_names_the_line() -> None:
    with pytest.raises(PmacError, match="line 2"):
        read_program(text_of("X10 bad", plc=False))


ABSENT = {
    "X1 CC1": "CC0 to CC3",
    "ccr 5": "CCR",
    "X!(3)": "altered destination (!)",
    "tsel 2": "TSELECT",
    "ADIS 3": "ADIS, AROT, IDIS, IROT",
    "PRELUDE1": "PRELUDE",
    "LEARN": "LEARN",
    "DISP 3 P1": "DISPLAY",
    "CLOSE\nOPEN ROT": "rotary buffers (ROT)",
    "CLOSE\nOPEN PLCC 3": "compiled PLCs (PLCC)",
}
"""Words of the manuals that docs/pmac-emulation.md lists under "Not there yet"."""


@pytest.mark.parametrize("body", list(ABSENT))
def test_a_word_that_is_absent_here_is_named_as_such(machine: MachineProfile, body: str) -> None:
    found = check_program(f"{text_of(body, plc=False)}\n", machine).findings
    assert [each.values["word"] for each in found if each.code is Code.WORD_ABSENT] == [ABSENT[body]]
