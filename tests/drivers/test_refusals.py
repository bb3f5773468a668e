"""ERR numbers: what the card refuses, in which state, as its reference lists them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drivers.errors import ControllerError

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
    assert bench.ask("#1->") == "X"


def test_003_a_less_or_equal_in_a_program(bench: Bench) -> None:
    bench.client.request("OPEN PROG 1 CLEAR")
    assert refusal(bench, "WHILE(P1<=2)") == 3
    bench.client.request("CLOSE")
    assert bench.client.request("LIST PROG 1") == ()


@pytest.mark.parametrize("line", ["X100", "TA10 TS5", "WHILE(P1=0)", "ENDWHILE", "INC", "DWELL5", "CLEAR"])
def test_005_program_lines_without_an_open_buffer(bench: Bench, line: str) -> None:
    assert refusal(bench, line) == 5


def test_007_a_second_buffer(bench: Bench) -> None:
    bench.client.request("OPEN PROG 1")
    assert refusal(bench, "OPEN PROG 1") == 7
    assert refusal(bench, "DELETE PROG 1") == 7


def test_009_an_end_without_its_beginning(closed: Bench) -> None:
    closed.program("ENDIF")
    assert refusal(closed, "R") == 9


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


def test_013_a_motor_that_this_machine_does_not_have(closed: Bench) -> None:
    assert refusal(closed, "#4J+") == 13
    assert refusal(closed, "#4->A") == 13
    assert len(closed.ask("??")) == 12


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


def test_a_refused_download_leaves_no_buffer_open(bench: Bench) -> None:
    with pytest.raises(ControllerError) as refused:
        bench.program("X100", "X<3")
    assert refused.value.error_number == 3
    assert refused.value.problems[0].value == "X<3"
    assert bench.ask("???")[6:] == "000000"
