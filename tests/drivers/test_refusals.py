"""ERR numbers: what the card refuses, in which state, as its reference lists them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drivers.errors import ControllerError
from drivers.simulator.card import buffers

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

ENDLESS = ("INC", "TA10 TS0 TM100", "WHILE(M26=0)", "X10", "X-10", "ENDWHILE")


def refusal(bench: Bench, line: str) -> int:
    with pytest.raises(ControllerError) as refused:
        bench.client.request(line)
    return refused.value.error_number


@pytest.fixture
def running(closed: Bench) -> Bench:
    """A program without an end is under way."""
    closed.program(*ENDLESS)
    closed.client.request("R")
    closed.sim.wait(0.3)
    return closed


@pytest.mark.parametrize(
    "line", ["J+", "J-", "J/", "J=", "J=100", "J^5", "HM", "K", "R", "OPEN PROG 2", "DELETE PROG 1", "#3->0"]
)
def test_001_what_a_running_program_does_not_allow(running: Bench, line: str) -> None:
    assert refusal(running, line) == 1
    assert running.lathe.snapshot().program_running


def test_001_ends_with_the_motion_and_not_with_the_calculation(closed: Bench) -> None:
    closed.program("INC", "TA10 TS0 TM300", "X3000")
    closed.client.request("R")
    closed.sim.wait(0.1)
    assert not closed.lathe.snapshot().program_running
    assert refusal(closed, "#1J+") == 1
    assert refusal(closed, "#1->0") == 1
    assert refusal(closed, "R") == 1
    closed.settle()
    closed.client.request("#1J/ #1->0")


def test_001_a_program_while_one_of_its_motors_jogs(closed: Bench) -> None:
    closed.program("X100")
    closed.client.request("#3J+")
    closed.sim.wait(0.3)
    assert refusal(closed, "R") == 1
    closed.client.request("#3J/")
    closed.settle()
    closed.client.request("R")


def test_control_k_needs_no_permission(running: Bench) -> None:
    assert refusal(running, "K") == 1
    running.raw(b"\x0b")
    snapshot = running.lathe.snapshot()
    assert not snapshot.program_running
    assert all("open_loop" in axis.flags for axis in snapshot.axes)
    running.client.request("K")


def test_a_running_program_allows_questions_and_variables(running: Bench) -> None:
    running.client.request("P1=5 M30=2")
    assert running.client.numbers("P1", "M30") == (5, 2)
    assert len(running.client.query("#1P", "#1V", "#1F", "?", "&1??", "#1P", "???")) == 7


@pytest.mark.parametrize(
    "line", ["UUU", "#9", "#0", "&9", "P1024", "P1..", "OPEN PROG 0", "LIST PROG 77", "B", "P1=", "J*"]
)
def test_003_what_is_no_command(bench: Bench, line: str) -> None:
    assert refusal(bench, line) == 3


def test_003_a_motor_of_another_coordinate_system(bench: Bench) -> None:
    assert refusal(bench, "&2 #1->X") == 3
    assert bench.ask("&1#1->") == "X"


def test_003_a_less_or_equal_in_a_program(bench: Bench) -> None:
    bench.client.request("OPEN PROG 1 CLEAR")
    assert refusal(bench, "WHILE(P1<=2)") == 3
    bench.client.request("CLOSE")
    assert bench.client.request("LIST PROG 1") == ("RET",)


@pytest.mark.parametrize("line", ["X100", "TA10 TS5", "WHILE(P1=0)", "ENDWHILE", "INC", "DWELL5", "CLEAR"])
def test_005_program_lines_without_an_open_buffer(bench: Bench, line: str) -> None:
    assert refusal(bench, line) == 5


def test_006_a_program_that_is_too_long_and_programs_that_are_too_many(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(buffers, "MAX_LINES", 3)
    monkeypatch.setattr(buffers, "ROOM_LINES", 5)
    bench.client.request("OPEN PROG 1 CLEAR")
    for line in ("X1", "X2", "X3"):
        bench.client.request(line)
    assert refusal(bench, "X4") == 6
    bench.client.request("CLOSE")
    bench.client.request("OPEN PROG 2 CLEAR")
    for line in ("X1", "X2"):
        bench.client.request(line)
    assert refusal(bench, "X3") == 6
    bench.client.request("CLOSE")
    assert bench.client.request("LIST PROG 1") == ("X1", "X2", "X3", "RET")


def test_007_a_second_buffer(bench: Bench) -> None:
    bench.client.request("OPEN PROG 1")
    assert refusal(bench, "OPEN PROG 1") == 7
    assert refusal(bench, "DELETE PROG 1") == 7


def test_009_an_end_without_its_beginning(closed: Bench) -> None:
    closed.program("ENDIF")
    assert refusal(closed, "R") == 9


def test_010_both_limits_of_a_motor_are_set(closed: Bench) -> None:
    closed.program("X100")
    travel = closed.sim.controller.motors[3].travel
    travel.plus_pin = travel.minus_pin = True
    closed.sim.wait(0.1)
    assert refusal(closed, "R") == 10


def test_011_the_move_before_is_not_completed(closed: Bench) -> None:
    closed.program("INC TA10 TS0 TM500", "X100", "X100", "X100")
    closed.client.request("S")
    closed.sim.wait(0.1)
    assert refusal(closed, "S") == 11
    closed.settle()
    closed.client.request("S")


def test_012_a_killed_motor_in_the_coordinate_system(closed: Bench) -> None:
    closed.program("X100")
    closed.client.request("#2K")
    assert refusal(closed, "R") == 12
    closed.client.request("#2J/ R")


def test_013_a_motor_that_is_not_activated(closed: Bench) -> None:
    closed.program("X100")
    closed.client.request("I300=0")
    assert refusal(closed, "R") == 13
    assert refusal(closed, "#3J+") == 13


@pytest.mark.parametrize("line", ["J+", "J/", "J=10", "J:5", "HM", "HMZ", "O5", "$", "$*"])
def test_013_a_motor_that_this_machine_does_not_use(closed: Bench, line: str) -> None:
    assert refusal(closed, f"#4{line}") == 13
    assert closed.client.query("#4P", "V", "F", "?") == ("0", "0", "0", "050000000000")


def test_014_a_coordinate_system_without_motors(closed: Bench) -> None:
    closed.program("X100")
    assert refusal(closed, "&2 B1R") == 14


def test_015_no_program_to_run(closed: Bench) -> None:
    assert refusal(closed, "R") == 15
    closed.program("X100")
    assert refusal(closed, "B7R") == 15


def test_015_after_any_open_every_pointer_is_lost(closed: Bench) -> None:
    closed.program("X100")
    closed.client.request("&2 B1 &1 B1")
    closed.client.request("OPEN PROG 2 CLOSE")
    assert refusal(closed, "R") == 15
    closed.client.request("&1 B1R")


def test_015_while_a_buffer_is_open(closed: Bench) -> None:
    closed.program("X100")
    closed.client.request("OPEN PROG 2")
    assert refusal(closed, "B1 R") in (3, 15)
    other = closed.sim.connect()
    other.receive(b"&1B1R\r")
    closed.sim.wait(0.011)
    assert other.take_output() == b"\x07ERR015\r"


@pytest.mark.parametrize("lines", [("WHILE(P1=0)", "X1"), ("IF(P1=0)", "X1")])
def test_016_a_block_without_its_end(closed: Bench, lines: tuple[str, ...]) -> None:
    closed.program(*lines)
    assert refusal(closed, "R") == 16


def test_017_a_motor_was_moved_since_the_program_was_stopped(closed: Bench) -> None:
    closed.program("INC TA10 TS0 TM100", "Z30", "Z30", "Z30")
    closed.client.request("S")
    closed.settle()
    closed.client.request("#3J:5")
    closed.settle()
    assert refusal(closed, "R") == 17
    closed.client.request("#3J=")
    closed.settle()
    closed.client.request("R")
    closed.settle()
    assert closed.number("#3P") == 90


def test_018_a_motor_that_moves_is_not_phased(closed: Bench) -> None:
    closed.client.request("#3J+")
    closed.sim.wait(0.2)
    assert refusal(closed, "$") == 18


def test_a_refused_download_leaves_no_buffer_open(bench: Bench) -> None:
    with pytest.raises(ControllerError) as refused:
        bench.program("X100", "X<3")
    assert refused.value.error_number == 3
    assert refused.value.problems[0].value == "X<3"
    assert bench.ask("???")[6:] == "000000"
