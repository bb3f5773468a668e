"""One host that floods the card keeps nobody else from it, and nobody from stopping the machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drivers.simulator.hosts.port import INBOX_LIMIT, Port

if TYPE_CHECKING:
    from drivers.simulator.machine import SimulatedLathe
    from tests.drivers.conftest import Bench

CYCLE_S = 0.005
"""A little more than one background cycle of the bundled machine, 11 x 443 us."""

FLOOD = b"P0..1000\r" * 500


def cycles_until_answered(sim: SimulatedLathe, port: Port, most: int = 2000) -> int:
    """Return how many background cycles pass until something is said."""
    for cycle in range(1, most):
        sim.wait(CYCLE_S)
        if port.take_output():
            return cycle
    raise AssertionError("no answer")


def drained(bench: Bench, seconds: float) -> bytes:
    said = b""
    for _ in range(round(seconds / CYCLE_S)):
        bench.sim.wait(CYCLE_S)
        said += bench.port.take_output()
    return said


@pytest.mark.parametrize("stop", [b"\x01", b"\x0b"])
def test_a_stop_behind_a_flood_acts_within_one_background_cycle(closed: Bench, stop: bytes) -> None:
    closed.client.request("#3J+")
    closed.sim.wait(1.0)
    motor = closed.sim.controller.motors[3]
    assert motor.velocity == pytest.approx(10.0)
    closed.port.receive(FLOOD + stop)
    closed.sim.wait(CYCLE_S)
    assert motor.jog.aborting if stop == b"\x01" else not motor.enabled


def test_a_stop_of_another_host_acts_before_the_lines_of_the_first(closed: Bench) -> None:
    """The flooding host is served first, and closes its loop again with its own jog."""
    other = closed.sim.connect()
    closed.port.receive(b"#3J+\r" + FLOOD)
    other.receive(b"\x0b")
    closed.sim.wait(CYCLE_S)
    assert [closed.sim.controller.motors[number].enabled for number in (1, 2, 3)] == [False, False, True]


def test_control_characters_act_in_their_order(closed: Bench) -> None:
    closed.raw(b"\x0b\x01")
    assert closed.lathe.snapshot().loops_closed
    closed.raw(b"\x01\x0b")
    assert not closed.lathe.snapshot().loops_closed


def test_another_host_is_answered_at_once_during_a_flood(bench: Bench) -> None:
    other = bench.sim.connect()
    bench.port.receive(FLOOD)
    for _ in range(20):
        other.receive(b"P1\r")
        assert cycles_until_answered(bench.sim, other) <= 2


def test_a_background_cycle_says_no_more_than_a_few_lines_long(bench: Bench) -> None:
    """A line of 1001 values is 2003 bytes; the third one brings the answers above 4096."""
    bench.port.receive(FLOOD)
    bench.sim.wait(10 * CYCLE_S)
    assert len(bench.port.take_output()) <= 11 * (4096 + 2003)


def test_control_x_empties_the_queue_in_front_of_it_and_only_that(bench: Bench) -> None:
    bench.port.receive(b"P1=1\r" * 500 + b"P2=7\rP3=\x18P4\r")
    assert drained(bench, 0.05) == b"0\r\x06"
    assert bench.client.numbers("P1", "P2") == (0, 0)


def test_lines_are_executed_and_answered_in_their_order(bench: Bench) -> None:
    bench.port.receive(b"".join(b"P1=%d P1\r" % number for number in range(200)))
    said = drained(bench, 200 / 4 * CYCLE_S + 0.05)
    assert said == b"".join(b"%d\r\x06" % number for number in range(200))


def test_a_program_typed_in_one_go_is_stored_within_a_tenth_of_a_second(bench: Bench) -> None:
    lines = ["OPEN PROG 1", "CLEAR", *(f"X{number}" for number in range(60)), "CLOSE"]
    bench.port.receive("".join(line + "\r" for line in lines).encode())
    bench.sim.wait(0.1)
    assert bench.port.take_output() == b"\x06" * len(lines)
    assert bench.client.request("LIST PROG 1") == (*lines[2:-1], "RET")


def test_a_line_that_comes_over_many_cycles_is_one_line(bench: Bench) -> None:
    for byte in b"P1=4\x082":
        bench.port.receive(bytes([byte]))
        bench.sim.wait(CYCLE_S)
    assert bench.raw("\r") == b"\x06"
    assert bench.number("P1") == 2


def test_a_host_with_too_much_in_the_queue_is_told_to_hold_back(bench: Bench) -> None:
    crowded = []
    for data in (b"P1\r" * (INBOX_LIMIT // 3), b"P1\r", b""):
        bench.port.receive(data)
        crowded.append(bench.port.crowded)
        bench.sim.wait(0.0 if len(crowded) < 2 else 2 * CYCLE_S)
    assert crowded == [False, True, False]


def test_bytes_without_an_end_of_line_do_not_pile_up(bench: Bench) -> None:
    bench.port.receive(b"x" * 10 * INBOX_LIMIT)
    bench.sim.wait(CYCLE_S)
    assert not bench.port.crowded
    assert bench.raw("\r") == b"\x07ERR003\r"
