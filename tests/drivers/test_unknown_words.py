"""A word that the card does not know does nothing at all, whatever known word it begins with."""

from __future__ import annotations

from random import Random

import pytest

from drivers.simulator.card.controller import Controller
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

KNOWN = frozenset(
    (
        "PAUPLC RESPLC GOS "
        "MOVETIME SID IDNUMBER PAUSEPLC RESUMEPLC MS MSR MSW MSCLRF DEFINELOOKAHEAD DEFINEUBUFFER DELETETEMPS "
        "DEFINELOOK DEFLOOK DEFLOOKAHEAD DEFINEUBUF DEFUBUF DEFUBUFFER "
        "ABS ADDRESS ADR BLOCKSTART BLOCKSTOP BSTART BSTOP CALL CHECKSUM CHKS CID CIR1 CIR2 CIRCLE1 CIRCLE2 "
        "CLEAR CLOSE CLR CLS CMD COMMAND CPU DATE DEFCOMP DEFGAT DEFGATHER DEFINECOMP DEFINEGAT DEFINEGATHER "
        "DELALL DELAY DELCOMP DELETEALL DELETECOMP DELETEGAT DELETEGATHER DELETEPLC DELETEPROG DELETETRACE "
        "DELGAT DELGATHER DELPLC DELPROG DELTRACE DISABLEPLC DISPLAY DISPLC DLY DWE DWELL ELSE ENABLEPLC "
        "ENAPLC ENDG ENDGATHER ENDI ENDIF ENDW ENDWHILE FRAX GAT GATHER GOSUB GOTO HM HMZ HOME HOMEZ IF INC "
        "LIN LINEAR LISTCOMP LISTCOMPDEF LISTGAT LISTGATHER LISTPC LISTPE LISTPLC LISTPROG LISTPROGRAM NOFRAX "
        "NORMAL NRM OPENPLC OPENPROG OPENPROGRAM PASSWORD PC PE PMATCH PR PSET PVT RAPID READ RET RETURN RPD "
        "SAVE SEND SIZE SPLINE1 SPLINE2 STOP TA TIME TM TODAY TS TYPE UNDEF UNDEFINE UNDEFINEALL VER VERSION "
        "VID WAIT WHILE "
    ).split()
)
"""Words of the manuals."""

OTHERS = frozenset(
    (
        "ABORT ABR ARM EAVERSION HALT HARD HOLD HOMEC JOG KILL KNOWN LEARN LOCK MFLUSH "
        "PAUSE QUERY QUIT RESET RESUME ROTFREE RUN SETPHASE SHARP SPLINE STEP UNLOCK "
        "ZERO ZZZ "
    ).split()
)
"""Words of other controllers and of later firmware, and some that no card has."""

UNUSED = ("", " PLC 1", "1", "$10", " 1", "P1", " ALL TEMPS", "=5")
"""What may follow a word."""

REPORTS = frozenset("PVF")

PROGRAM_TEXT = ("CLEAR", "HOME1", "X5", "RAPID", "ABS", "RETURN", 'CMD"#1J+"', 'SEND"x"', "DWELL10", "AND(P1=1)")
"""What only a buffer takes."""


def state(card: Controller) -> tuple[object, ...]:
    """All that a command could change."""
    variables = card.variables
    return (
        dict(variables.settings()),
        list(variables._p),
        {number: dict(values) for number, values in variables._q.items()},
        dict(variables._m),
        dict(variables.pointers),
        {number: list(lines) for number, lines in card.programs.items()},
        {number: list(lines) for number, lines in card.plcs.buffers.items()},
        card.plcs.switches,
        card.open_buffer,
        card.password.text,
        [
            (m.amplifier_enabled, m.enabled, m.desired, m.velocity, m.home_complete, m.jogging)
            for m in card.motors.values()
        ],
        [
            (s.running, s.moving, s.program_number, s.time_base.percent, dict(s.frame.definitions))
            for s in card.systems.values()
        ],
        dict(card.tables.tables),
        (card.gather.size, card.gather.running),
        list(card.host.pending_commands),
    )


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine)


@pytest.fixture
def ready(card: Wire) -> Wire:
    """A card with something for every word to act on: a program, a PLC, closed loops, a buffer."""
    card.tell("I5=0 P1=7", "OPEN PLC 1 CLEAR", "P2=P2+1", "CLOSE", "OPEN PROG 1 CLEAR", "DWELL500", "CLOSE")
    card.tell("#1J/ #2J/ #3J/", "&1B1", "DEFINE GATHER 100", "I21=$C0 I20=1")
    return card


def second(card: Wire) -> Wire:
    """Another host of the same card."""
    return Wire(sim=card.sim, port=card.sim.connect())


def is_command(word: str) -> bool:
    """Whether a run of letters is a command after all: one letter, or reports only (`PM1`: P, and M1)."""
    return word in KNOWN or len(word) == 1 or (set(word[:-1]) <= REPORTS and word[-1] in "PVFIQM")


def unknown() -> list[str]:
    """The beginnings of the words, and words with something wrong behind them."""
    begun = {word[:end] for word in KNOWN for end in range(2, len(word))}
    spoilt = {word + end for word in KNOWN for end in ("X", "S", "R")}
    rest = {word for word in begun | spoilt if not is_command(word)}
    return sorted(rest | OTHERS)


def test_the_words_of_the_reports_are_no_commands_that_act(ready: Wire) -> None:
    """The oracle above: letters that act are none of those that may stand in a row."""
    assert not REPORTS & set("RSHQAZKO$J")
    assert len(unknown()) > 500


def test_a_word_that_is_not_known_changes_nothing(ready: Wire) -> None:
    before = state(ready.card)
    random = Random(23)
    wrong = []
    for word in unknown():
        for tail in random.sample(UNUSED, 3):
            if word + tail.replace(" ", "").rstrip("1") in KNOWN:
                continue  # `DEL PLC 1`
            if word == "RP" and tail in ("1", " 1", "$10"):
                continue  # a word of the memory is read
            for line in (word + tail, f"P1=8 {word}{tail}"):
                said = ready.raw(line + "\r")
                if not said:  # the share of this host is used up
                    ready.sim.wait(0.1)
                    said = ready.port.take_output()
                if state(ready.card) != before:
                    wrong.append((line, said))
                    ready.raw("P1=7\r")
                    before = state(ready.card)
    assert wrong == []


@pytest.mark.parametrize(
    "line", ["RESUME PLC 1", "RP$10", "SIDX", "SETPHASE1", "ABR", "DELETE ALL TEMPS", "$$", "RAPS"]
)
def test_what_public_tools_have_sent_by_mistake_does_nothing(ready: Wire, line: str) -> None:
    before = state(ready.card)
    ready.raw(line + "\r")
    assert state(ready.card) == before


@pytest.mark.parametrize(
    "refused", ["OPEN PROG 0", "OPEN PROG 99999", "OPEN PLC 77", "OPEN NOTHING 1", "OPEN ROT", "X OPEN PROG 2"]
)
def test_a_refused_open_leaves_the_host_on_line(ready: Wire, refused: str) -> None:
    """User Manual: what can be a command acts if no buffer is open, the rest is ERR005."""
    before = state(ready.card)
    assert ready.refusal(refused) in (3, 5)
    assert {ready.refusal(line) for line in PROGRAM_TEXT} <= {3, 5}
    assert state(ready.card) == before
    ready.tell("P1=5", "I130=500", "M1=1", "5")
    assert ready.ask("P1 I130 P0") == ["5", "500", "5"]


def test_no_line_of_a_program_is_taken_apart_into_letters(ready: Wire) -> None:
    """The R of RAPID would run the program, the A of ABS abort it, the S of SEND step it."""
    before = state(ready.card)
    assert ready.refusal("OPEN ROT") == 3
    for line in PROGRAM_TEXT:
        assert ready.refusal(line) in (3, 5), line
    assert state(ready.card) == before


def test_a_buffer_that_somebody_else_opened_takes_nothing_of_a_second_host(ready: Wire) -> None:
    other = second(ready)
    other.tell("OPEN PROG 5 CLEAR")
    assert ready.refusal("OPEN PROG 6 CLEAR P1=3") == 7
    assert ready.refusal("X1") == 5
    ready.tell("P1=1")
    assert ready.ask("P1") == ["1"]
    assert other.listed("PROG 5") == []


def test_what_follows_when_somebody_else_has_closed_a_buffer_is_on_line(ready: Wire) -> None:
    other = second(ready)
    ready.tell("OPEN PROG 5 CLEAR", "X1")
    other.tell("CLOSE")
    assert ready.refusal("X2") == 5
    ready.tell("P1=1")
    assert ready.ask("P1 LIST PROG 5") == ["1", "X1", "RET"]


def test_a_line_that_opens_and_closes_is_its_own_body(ready: Wire) -> None:
    assert ready.refusal("OPEN PROG 99999 CLEAR X1 CLOSE") == 3
    ready.tell("P1=1")
    assert ready.ask("P1") == ["1"]
