"""Programs that were made for tests, any commands, and what is downloaded of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.downloadable import refusals
from drivers.commissioning.downloading import differing, plan_download, send
from drivers.pmac.analysis.findings import FindingCode
from drivers.pmac.analysis.program import check_program
from drivers.pmac.dialect import TURBO, Dialect
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import unary_functions
from drivers.pmac.language.parser import WORDS
from drivers.pmac.language.plc_statements import PLC_WORDS
from drivers.pmac.program_text import ProgramText, RefusedLine, read_program
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.commands.line import read_line
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.commissioned import Commissioned, commissioned
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
from tests.drivers.wire_card import CYCLE_MS, IdealCard, Wire, wire

ENDING = "OPEN PROG 2 CLEAR\nCLOSE"
"""A text needs a motion program to be one."""


LINES = (FindingCode.LINE_REFUSED, FindingCode.WORD_ABSENT)
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


def test_every_word_of_the_language_is_in_one_of_many_programs() -> None:
    assert len({*MOTION, *PLCS, *REFUSED_MOTION, *REFUSED_PLCS}) >= 150
    motion, plcs = without_blanks(MOTION), without_blanks(PLCS)
    functions = (*unary_functions(degrees=True), "ATAN2")
    assert [word for word in (*WORDS, *functions) if word not in motion] == []
    assert [word for word in PLC_WORDS if word not in plcs] == []
    comparators = ("=", "!=", ">", "!>", "<", "!<", "~", "!~")
    assert [word for word in (*comparators, *"+-*/%&|^") if word not in motion] == []


def without_blanks(bodies: Iterable[str]) -> str:
    return re.sub(r"[ \t]", "", "\n".join(bodies)).upper()


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
        refusals = [each for each in found.findings if each.code in (*LINES, FindingCode.RUN_TIME_ERROR)]
        assert all(each.lines and each.values["error"] for each in refusals), body
        if body in REFUSED_MOTION:
            assert [
                each.lines for each in refusals if each.code in (FindingCode.LINE_REFUSED, FindingCode.WORD_ABSENT)
            ] == [(2,)], body


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
    assert [each.values["word"] for each in found if each.code is FindingCode.WORD_ABSENT] == [ABSENT[body]]


# Buffers of a text at a card: every program that the check accepts arrives, and is listed as it was read.

FULL_AFTER = 40  # programs, after which the card is emptied: its memory ends


def texts(dialect: Dialect) -> Iterator[str]:
    """Each made program in a buffer of its kind."""
    yield from (f"OPEN PROG {100 + n % 50} CLEAR\n{body}\nCLOSE\n" for n, body in enumerate(MOTION))
    yield from (f"OPEN PLC {n % 19} CLEAR\n{body}\nCLOSE\n" for n, body in enumerate(PLCS))
    if dialect.kinematics is not None:
        yield from (f"&3 OPEN INVERSE CLEAR\n{body}\nCLOSE\n" for body in KINEMATIC)
        yield from (f"&2\nOPEN FORWARD CLEAR\n{body}\nCLOSE\n" for body in KINEMATIC)


def arrives(card: Commissioned, read: ProgramText) -> int:
    """Send the buffers of a text; return how many lines the card then lists, each as it was expected."""
    dialect, buffers = card.client.dialect, read.source.buffers
    changes = plan_download(card.client, dialect, buffers)
    send(card.client, dialect, changes, "text", lambda sent, of: None)
    for form in range(4):  # the last one is the full one
        card.client.request(f"I9={form}")
        assert differing(card.client, changes) == []
        assert not any(change.differs for change in plan_download(card.client, dialect, buffers)), f"I9={form}"
    count = 0
    for change in changes:
        question = change.buffer.kind.line("LIST", change.buffer.number)
        *listed, end = (line.strip() for line in card.client.question(question))
        assert end == "RETURN"
        # To the letter; that is more than is asked of another card, which may shorten words.
        assert [line.text for line in change.wanted] == listed
        count += len(listed)
    return count


@pytest.mark.first(1)
@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_every_program_that_the_check_accepts_arrives(family: str) -> None:
    card = commissioned(of_family(load_machine("lee-2001-lathe").machine, family))
    card.client.connect()
    dialect, count = card.client.dialect, 0
    for number, text in enumerate(texts(dialect)):
        read = read_program(text, motor_count=dialect.motor_count, needs_program=False)
        assert refusals(read.source, "text", "pmac") == (), text
        count += arrives(card, read)
        if number % FULL_AFTER == FULL_AFTER - 1:
            card.tell("DELETE ALL")
    assert count > 190


def test_names_are_replaced_before_anything_is_sent() -> None:
    card = commissioned(load_machine("lee-2001-lathe").machine)
    card.client.connect()
    for number, text in enumerate(PREPROCESSED, start=101):
        own = text.replace("PROG 1 ", f"PROG {number} ")
        if "PLC" in own:
            own = own.replace("CLOSE\nOPEN PROG", "CLOSE\n&1\nOPEN PROG")
        read = read_program(own)
        assert refusals(read.source, "text", "pmac") == ()
        arrives(card, read)
    heard = card.line.heard.decode("latin-1")
    assert "#d" not in heard and "#if" not in heard and "FOO" not in heard
    assert 'CMD"#1 J/"' in heard


# Whatever a host sends, and when: nothing breaks, no motor jumps, and the card rests when it is told to.

PROGRAMS = (
    (
        "INC TA20 TS5 TM50",
        "X500 Y100",
        "X-300",
        "BSTART",
        "X200",
        "Y50",
        "BSTOP",
        "DWELL20",
        "X100",
        "STOP",
        "X-400",
    ),
    ("ABS TA10 TS0 TM40", "X200", "HOME1", "X100", "PSET X0 Y5", "X-50", "HOMEZ2", "Y30"),
    ("INC", "PVT50", "X200:4000", "X200:4000", "X100:0", "LINEAR TA10 TM60 X-300 Y100", "DELAY30", "M1==1 X40"),
    ("INC TA20 TS0 TM30", "WHILE(P1<40)", "P1=P1+1", "X100", "X-90", "ENDWHILE"),
    ("RAPID INC X300 Y-100", "SPLINE1 TA40 X50", "X50", "LINEAR TM100 X500", "GOTO77"),
)

Act = Callable[[IdealCard], object]

ACTS: dict[str, Act] = {
    "R": lambda card: card.system.run(),
    "S": lambda card: card.system.step(),
    "Q": lambda card: card.system.quit(),
    "/": lambda card: card.system.stop_at_block(),
    "H": lambda card: card.system.hold(),
    "A": lambda card: card.system.abort(),
    "%0": lambda card: card.system.set_override(0),
    "%40": lambda card: card.system.set_override(40),
    "%100": lambda card: card.system.set_override(100),
    "%200": lambda card: card.system.set_override(200),
    "PMATCH": lambda card: card.system.match_positions(),
    "Z": lambda card: card.system.zero_axes(),
    "^A": lambda card: card.controller.abort_all(),
    "^R": lambda card: card.controller.each_system(CoordinateSystem.run),
    **{f"B{number}": lambda card, number=number: card.system.point(number) for number in range(1, 6)},  # type: ignore[misc]
}
JOGS: dict[str, Act] = {
    "J+": lambda card: card.motor().jog_speed(1),
    "J-": lambda card: card.motor().jog_speed(-1),
    "J/": lambda card: card.motor().jog_speed(0),
    "J=": lambda card: card.motor().jog_back(),
    "J=700": lambda card: card.motor().jog_to(700),
    "J:-90": lambda card: card.motor().jog_by(-90),
    "J=900^5": lambda card: card.motor().jog_to(900, 5),
    "HM": lambda card: card.motor().home(),
    "HMZ": lambda card: card.motor().home_zero(),
}

FASTEST = 50.0
"""Counts/ms: a jog; the programs make 20 at most (Ix16), and 40 at 200 %."""


def do(card: IdealCard, name: str) -> None:
    with suppress(PmacError):
        if name in JOGS:
            card.controller.refuse_in_control(1)
            JOGS[name](card)
        else:
            ACTS[name](card)


@given(
    st.integers(1, 5),
    st.sampled_from([0, 10]),
    st.lists(st.tuples(st.sampled_from([*ACTS, *JOGS, "R", "R", "S", "H"]), st.integers(0, 25)), max_size=14),
)
def test_no_motor_jumps_and_a_stop_stops(program: int, segment_ms: int, acts: list[tuple[str, int]]) -> None:
    card = IdealCard(I113=60_000, I114=-60_000, I116=20, I216=20, I13=segment_ms, I194=40_000, I195=40_000)
    for number, lines in enumerate(PROGRAMS, start=1):
        card.store(*lines, number=number)
    card.system.point(program)
    machine: list[float] = []
    for name, blocks in [("R", 5), *acts]:
        do(card, name)
        for _ in range(blocks):
            card.block()
            machine.append(card.motor().actual + card.motor().axis.origin)
    if not segment_ms:  # segmented moves know no Ix16
        assert np.abs(np.diff(machine)).max() <= FASTEST * 11 * CYCLE_MS * 1.001
    assert all(card.motor(number).enabled for number in (1, 2))
    card.controller.abort_all()
    card.wait(200)
    assert not card.system.moving
    assert not card.system.running
    assert all(card.motor(number).velocity == 0 for number in (1, 2))
    assert all(card.motor(number).in_position for number in (1, 2))
