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


def test_001_what_a_running_program_does_not_allow_beside_questions_and_variables(running: Bench) -> None:
    for line in (*"J+ J- J/ J= J=100 J^5 HM K R #3->0".split(), "OPEN PROG 2", "DELETE PROG 1"):
        assert refusal(running, line) == 1, line
        assert running.lathe.snapshot().program_running
    running.client.request("P1=5 M30=2")
    assert running.client.numbers("P1", "M30") == (5, 2)
    assert len(running.client.query("#1P", "#1V", "#1F", "?", "&1??", "#1P", "???")) == 7


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


def test_what_is_no_command_and_what_belongs_to_a_buffer_or_to_a_motor_in_use(closed: Bench) -> None:
    for line in (*"UUU #9 #0 &9 P1024 P1.. B P1= J*".split(), "OPEN PROG 0", "LIST PROG 77"):
        assert refusal(closed, line) == 3, line
    for line in (*"X100 WHILE(P1=0) ENDWHILE INC DWELL5 CLEAR".split(), "TA10 TS5"):
        assert refusal(closed, line) == 5, line
    for line in "J+ J/ J=10 J:5 HM HMZ O5 $ $*".split():
        assert refusal(closed, f"#4{line}") == 13, line
    assert closed.client.query("#4P", "V", "F", "?") == ("0", "0", "0", "050000000000")


def test_a_refused_download_leaves_no_buffer_open(bench: Bench) -> None:
    with pytest.raises(ControllerError) as refused:
        bench.program("X100", "X<3")
    assert refused.value.error_number == 3
    assert refused.value.problems[0].value == "X<3"
    assert bench.ask("???")[6:] == "000000"
