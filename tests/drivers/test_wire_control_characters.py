"""Every control character: what it does at once, between lines, in the middle of one, and behind a queue."""

from __future__ import annotations

import string

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

STOP_AND_GO = ("OPEN PROG1 CLEAR", "INC TA10 TS0 TM100", "WHILE(P1=0)", "X10", "X-10", "ENDWHILE", "CLOSE")


def code(letter: str) -> str:
    return chr(ord(letter) - 64)


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    return wire(machine, dialect)


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


def test_control_b_reports_the_status_of_eight_motors(card: Wire) -> None:
    said = card.raw(code("B"))
    assert said.endswith(b"\r")
    assert said.decode().split() == [card.ask(f"#{motor}?")[0] for motor in range(1, 9)]


def test_control_c_reports_the_status_of_all_coordinate_systems(card: Wire) -> None:
    said = card.raw(code("C"))
    assert said.endswith(b"\r")
    assert said.decode().split() == [card.ask(f"&{system}??")[0] for system in card.card.systems]


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


def test_control_g_reports_the_global_status(card: Wire) -> None:
    assert card.raw(code("G")) == card.ask("???")[0].encode() + b"\r"


def test_control_h_is_backspace(card: Wire) -> None:
    card.tell("\x08P1=457\x08\x086")
    assert card.ask("P1") == ["46"]


def test_control_i_repeats_the_last_line(card: Wire) -> None:
    card.tell("P1=1")
    card.tell("P1=P1+1")
    assert card.raw("\t\t") == b"\x06\x06"
    assert card.ask("P1") == ["4"]
    assert card.raw("\t") == b"4\r\x06"


def test_control_i_is_white_space_inside_a_line_and_while_a_program_is_typed(card: Wire) -> None:
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


def test_control_x_empties_line_queue_and_answers(card: Wire) -> None:
    assert card.raw("P1\rP2\rP1=12\x18P3\r") == b"0\r\x06"
    assert card.ask("P1") == ["0"]


@pytest.mark.parametrize(("i63", "echo"), [(0, b""), (1, b"\x18")])
def test_i63_echoes_control_x_when_it_is_done(card: Wire, i63: int, echo: bytes) -> None:
    card.tell(f"I63={i63}")
    assert card.raw("P1\rP2=1\x18") == echo
    assert card.ask("P2") == ["0"]


def test_control_y_reports_the_last_line(card: Wire) -> None:
    card.tell("p1 = 5")
    assert card.raw(code("Y")) == b"p1 = 5\r"


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
def test_on_a_turbo_the_bank_says_which_eight_motors_are_reported(
    machine: MachineProfile, bank: int, motors: range
) -> None:
    card = wire(machine, TURBO)
    card.tell("I2900=1", f"##{bank}")
    assert card.ask("##") == [str(bank)]
    assert card.raw(code("B")).decode().split() == [card.ask(f"#{motor}?")[0] for motor in motors]


def test_there_are_no_more_banks_than_motors(machine: MachineProfile) -> None:
    assert wire(machine, TURBO).refusal("##4") == 3
    assert wire(machine).ask("#3 ##5 #") == ["3", "5"]
