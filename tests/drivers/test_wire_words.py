"""Every control character, and words that the card does not know."""

from __future__ import annotations

import string
from random import Random

import pytest

from drivers.pmac.dialect import TURBO
from drivers.simulator.card.controller import SimulatedController
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

STOP_AND_GO = ("OPEN PROG1 CLEAR", "INC TA10 TS0 TM100", "WHILE(P1=0)", "X10", "X-10", "ENDWHILE", "CLOSE")


def code(letter: str) -> str:
    return chr(ord(letter) - 64)


@pytest.fixture
def running(card: Wire) -> Wire:
    """Loops closed, a program without an end under way in &1."""
    card.tell("#1J/ #2J/ #3J/", *STOP_AND_GO, "&1B1R")
    card.sim.wait(0.3)
    assert card.card.systems[1].running
    return card


@pytest.mark.parametrize("letter", sorted(set(string.ascii_uppercase) - set("HIMX")))
def test_no_control_character_disturbs_a_line(card: Wire, letter: str) -> None:
    """Not even between the characters of a word; what it says itself comes first."""
    said = card.raw(f"P1=4{code(letter)}2\r")
    assert said.endswith(b"\x06")
    assert card.ask("P1") == ["42"]


def test_control_a_aborts_programs_and_closes_open_loops(running: Wire) -> None:
    running.raw(code("K"))
    assert running.raw(code("A")) == b""
    running.settle()
    assert not running.card.systems[1].running
    assert [running.card.motors[number].enabled for number in (1, 2, 3)] == [True] * 3


def test_control_b_c_and_g_report_what_the_questions_do(card: Wire) -> None:
    said = card.raw(code("B"))
    assert said.endswith(b"\r")
    assert said.decode().split() == [card.ask(f"#{motor}?")[0] for motor in range(1, 9)]
    said = card.raw(code("C"))
    assert said.endswith(b"\r")
    assert said.decode().split() == [card.ask(f"&{system}??")[0] for system in card.card.systems]
    assert card.raw(code("G")) == card.ask("???")[0].encode() + b"\r"


def test_control_d_disables_every_plc(card: Wire) -> None:
    card.tell("ENABLE PLC 1..4")
    assert card.card.plcs.switches.enabled == {1, 2, 3, 4}
    assert card.raw(code("D")) == b""
    assert card.card.plcs.switches.enabled == set()


def test_control_f_p_and_v_report_eight_motors_each(card: Wire) -> None:
    card.tell("#1J/ #2J/ #3J/", "#2J=1000", "#3J+")
    card.sim.wait(0.5)
    for letter, command in (("F", "F"), ("P", "P"), ("V", "V")):
        said = card.raw(code(letter))
        assert said.endswith(b"\r")
        assert said.decode().split() == [card.ask(f"#{motor}{command}")[0] for motor in range(1, 9)]
    assert float(card.raw(code("V")).decode().split()[2]) != 0


def test_control_h_is_backspace_and_control_y_reports_the_last_line(card: Wire) -> None:
    card.tell("\x08P1=457\x08\x086")
    assert card.ask("P1") == ["46"]
    card.tell("p1 = 5")
    assert card.raw(code("Y")) == b"p1 = 5\r"


def test_control_i_repeats_the_last_line_and_is_white_space_inside_one(card: Wire) -> None:
    card.tell("P1=1")
    card.tell("P1=P1+1")
    assert card.raw("\t\t") == b"\x06\x06"
    assert card.ask("P1") == ["4"]
    assert card.raw("\t") == b"4\r\x06"
    card.tell("P1=5\t+ 1", "OPEN PROG1 CLEAR", "\tX10", "\tX20", "CLOSE")
    assert card.ask("P1 LIST PROG1") == ["6", "X10", "X20", "RET"]


def test_control_k_kills_every_motor_also_in_a_program(running: Wire) -> None:
    assert running.raw(code("K")) == b""
    assert not any(motor.enabled for motor in running.card.motors.values())
    assert not running.card.systems[1].running


def test_control_o_holds_every_system_and_control_r_goes_on(running: Wire) -> None:
    running.raw(code("O"))
    running.sim.wait(2.0)
    assert running.ask("%") == ["0"]
    before = running.ask("#1P")
    running.sim.wait(0.5)
    assert running.ask("#1P") == before
    running.raw(code("R"))
    running.sim.wait(2.0)
    assert running.ask("%") == ["100"]
    assert running.card.systems[1].running


def test_control_q_quits_and_control_r_runs(running: Wire) -> None:
    running.raw(code("Q"))
    running.settle()
    assert not running.card.systems[1].running
    running.raw(code("R"))
    running.sim.wait(0.1)
    assert running.card.systems[1].running


def test_control_s_does_one_step(card: Wire) -> None:
    card.tell("#1J/ #2J/ #3J/", "OPEN PROG1 CLEAR", "INC TA10 TS0 TM100", "X10", "X10", "X10", "CLOSE", "&1B1")
    before = float(card.ask("#1P")[0])
    card.raw(code("S"))
    card.settle()
    assert float(card.ask("#1P")[0]) == pytest.approx(before + 10, abs=1)
    card.raw(code("S"))
    card.settle()
    assert float(card.ask("#1P")[0]) == pytest.approx(before + 20, abs=1)


@pytest.mark.parametrize(("i63", "echo"), [(0, b""), (1, b"\x18")])
def test_i63_echoes_control_x_when_it_is_done(card: Wire, i63: int, echo: bytes) -> None:
    card.tell(f"I63={i63}")
    assert card.raw("P1\rP2=1\x18") == echo
    assert card.ask("P2") == ["0"]


@pytest.mark.parametrize("letter", ["E", "L", "T", "U", "W", "Z", "J"])
def test_what_this_card_has_no_use_for_is_ignored(card: Wire, letter: str) -> None:
    assert card.raw(code(letter)) == b""
    assert card.ask("???") == ["000001000000"]


@pytest.mark.parametrize("letter", ["B", "C", "F", "G", "P", "V"])
def test_an_answer_comes_before_those_of_the_lines_that_wait_and_never_inside_one(card: Wire, letter: str) -> None:
    card.port.receive(b"P1..3\r" * 20)
    card.sim.attend(card.port)
    card.port.receive(code(letter).encode())
    answer = card.raw("")
    alone = wire_answer(card, letter)
    assert answer.count(alone) == 1
    assert answer.replace(alone, b"") == b"0\r0\r0\r\x06" * 20


def wire_answer(card: Wire, letter: str) -> bytes:
    return card.raw(code(letter))


@pytest.mark.parametrize(("bank", "motors"), [(0, range(1, 9)), (1, range(9, 17)), (3, range(25, 33))])
def test_the_bank_says_which_eight_motors_are_reported(machine: MachineProfile, bank: int, motors: range) -> None:
    card = wire(machine, TURBO)
    card.tell("I2900=1", f"##{bank}")
    assert card.ask("##") == [str(bank)]
    assert card.raw(code("B")).decode().split() == [card.ask(f"#{motor}?")[0] for motor in motors]


def test_there_are_no_more_banks_than_motors(machine: MachineProfile) -> None:
    assert wire(machine, TURBO).refusal("##4") == 3
    assert wire(machine).ask("#3 ##5 #") == ["3", "5"]


# A word that the card does not know does nothing at all, whatever known word it begins with.

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


def state(pmac_card: SimulatedController) -> tuple[object, ...]:
    """All that a command could change."""
    variables = pmac_card.variables
    return (
        dict(variables.settings()),
        list(variables._p),
        {number: dict(values) for number, values in variables._q.items()},
        dict(variables._m),
        dict(variables.pointers),
        {number: list(lines) for number, lines in pmac_card.programs.items()},
        {number: list(lines) for number, lines in pmac_card.plcs.buffers.items()},
        pmac_card.plcs.switches,
        pmac_card.open_buffer,
        pmac_card.password.text,
        [
            (m.amplifier_enabled, m.enabled, m.desired, m.velocity, m.home_complete, m.jogging)
            for m in pmac_card.motors.values()
        ],
        [
            (s.running, s.moving, s.program_number, s.time_base.percent, dict(s.frame.definitions))
            for s in pmac_card.systems.values()
        ],
        dict(pmac_card.tables.tables),
        (pmac_card.gather.size, pmac_card.gather.running),
        list(pmac_card.host.pending_commands),
    )


@pytest.fixture
def pmac_card(machine: MachineProfile) -> Wire:
    return wire(machine)


@pytest.fixture
def ready(pmac_card: Wire) -> Wire:
    """A card with something for every word to act on: a program, a PLC, closed loops, a buffer."""
    pmac_card.tell("I5=0 P1=7", "OPEN PLC 1 CLEAR", "P2=P2+1", "CLOSE", "OPEN PROG 1 CLEAR", "DWELL500", "CLOSE")
    pmac_card.tell("#1J/ #2J/ #3J/", "&1B1", "DEFINE GATHER 100", "I21=$C0 I20=1")
    return pmac_card


def second(pmac_card: Wire) -> Wire:
    """Another host of the same card."""
    return Wire(sim=pmac_card.sim, port=pmac_card.sim.connect())


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
