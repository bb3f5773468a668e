"""What one host sends may be heavy: it is done in parts, and everybody else is served between them."""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import pairwise

import pytest

from drivers.pmac.dialect import TURBO
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.card.controller import Controller
from drivers.simulator.hosts.port import LINES_PER_TURN, WORK_PER_CYCLE
from profiles.machine import MachineProfile
from tests.drivers.wire_board import BoardWire, wire_board
from tests.drivers.wire_card import CYCLE_S, Wire, wire

VALUES = 8192
"""I0 to I8191."""

RANGE = b"I0..8191\r"


@pytest.fixture
def card(machine: MachineProfile) -> Wire:
    return wire(machine, TURBO)


@pytest.fixture
def board(machine: MachineProfile) -> BoardWire:
    return wire_board(machine, TURBO)


def answers(card: Wire, cycles: int) -> bytes:
    said = b""
    for _ in range(cycles):
        card.sim.wait(CYCLE_S)
        said += card.port.take_output()
    return said


def counted(monkeypatch: pytest.MonkeyPatch, name: str) -> list[str]:
    """Count how often the card is told to do something."""
    calls: list[str] = []
    done: Callable[[Controller], None] = getattr(Controller, name)

    def act(controller: Controller) -> None:
        calls.append(name)
        done(controller)

    monkeypatch.setattr(Controller, name, act)
    return calls


@pytest.mark.parametrize("report", [b"\x02", b"\x03", b"\x06", b"\x07", b"\x10", b"\x16"])
def test_reports_beyond_the_share_wait_in_their_order_and_none_is_lost(card: Wire, report: bytes) -> None:
    one = card.raw(report)
    card.port.receive(report * 300 + b"P1\r")
    card.sim.attend(card.port)
    assert card.port.take_output() == one * LINES_PER_TURN
    assert answers(card, 100) == one * (300 - LINES_PER_TURN) + b"0\r\x06"


def test_another_host_is_answered_and_heard_at_once_while_reports_wait(card: Wire) -> None:
    card.tell("I200=1", "#2J/")
    other = card.sim.connect()
    card.port.receive(b"\x03" * 64_000)
    card.sim.attend(card.port)
    other.receive(b"P1\r\x0b")
    card.sim.attend(other)
    assert other.take_output() == b"0\r\x06"
    assert not card.card.motors[2].enabled


def test_a_stop_of_the_same_host_does_not_wait_for_its_reports(card: Wire) -> None:
    card.tell("I200=1", "#2J/")
    card.port.receive(b"\x03" * 1000 + b"\x0b")
    card.sim.attend(card.port)
    assert not card.card.motors[2].enabled
    card.port.receive(b"\x18P1\r")
    card.sim.attend(card.port)
    assert card.port.take_output() == b"0\r\x06"


def test_a_report_between_two_stops_tells_of_the_first(card: Wire) -> None:
    card.tell("I200=1", "#2J/")
    closed, opened = card.raw(b"\x01\x02"), card.raw(b"\x0b\x02")
    assert opened != closed
    assert card.raw(b"\x01\x02\x0b\x02") == closed + opened


def test_thousands_of_stops_in_one_go_are_a_few(card: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    aborts, kills = counted(monkeypatch, "abort_all"), counted(monkeypatch, "kill_all")
    card.tell("I200=1", "#2J/")
    card.port.receive(b"\x01\x0b" * 30_000 + b"P1\r\x01" * 1000)
    card.sim.attend(card.port)
    assert (len(aborts), len(kills)) == (1, 1)
    assert card.card.motors[2].enabled


def test_control_characters_in_the_text_of_an_ethernet_client_have_the_same_share(board: BoardWire) -> None:
    board.response(b"I3=2")
    board.session.receive(struct.pack(">BBHHH", 0x40, 0xB0, 0, 0, 1000) + b"\x07" * 1000)
    assert board.session.turn() == [b"@"]
    assert 0 < board.session._queue.count(b"\r") <= 2 * LINES_PER_TURN


def test_requests_of_an_ethernet_client_that_does_not_wait_have_the_same_share(board: BoardWire) -> None:
    board.response(b"I3=2")
    request = struct.pack(">BBHHH", 0x40, 0xBF, 0, 0, 8) + b"I0..8191"
    flush = struct.pack(">BBHHH", 0x40, 0xB3, 0, 0, 0)
    board.session.receive((request + flush) * 100)
    said = []
    for _ in range(80):
        board.sim.wait(CYCLE_S)
        turn: list[bytes] = []
        while not turn or board.session.busy:
            turn = board.session.turn()
            said += turn
            if not turn:
                break
    assert len(said) / 2 == pytest.approx(80 * WORK_PER_CYCLE / VALUES, abs=2)


def test_commands_of_programs_have_a_share_too(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", *('CMD"P1..8191=P1+1"' for _ in range(20)), "CLOSE", "#1J/ #2J/ #3J/", "B1R")
    card.sim.wait(CYCLE_S)
    counts = [p1(card)]
    for _ in range(5):
        card.sim.wait(CYCLE_S)
        counts.append(p1(card))
    assert max(after - before for before, after in pairwise(counts)) == 1


def test_who_asks_for_thousands_of_values_waits_for_them(card: Wire) -> None:
    """Each line is as much as eight background cycles make good; a first one is there at once."""
    card.port.receive(RANGE * 100)
    said = answers(card, 80)
    assert said.count(b"\x06") == pytest.approx(80 * WORK_PER_CYCLE / VALUES, abs=2)
    other = card.sim.connect()
    for _ in range(10):
        other.receive(b"P1\r")
        card.sim.attend(other)
        assert other.take_output() == b"0\r\x06"
        card.sim.wait(CYCLE_S)


def test_who_asks_for_thousands_of_values_one_line_at_a_time_is_not_kept_waiting(card: Wire) -> None:
    before = card.sim.now_s()
    for _ in range(3):
        assert len(card.ask("I0..8191")) == VALUES
    assert card.sim.now_s() == before


def test_assignments_of_thousands_of_values_count_too(card: Wire) -> None:
    card.port.receive(b"P1..8191=SIN(P1)\r" * 100)
    assert answers(card, 80).count(b"\x06") == pytest.approx(80 * WORK_PER_CYCLE / VALUES, abs=2)


def p1(card: Wire) -> float:
    return card.card.variables.get(VariableKind.P, 1)


def test_a_long_line_of_heavy_commands_is_done_in_parts_and_answered_once(card: Wire) -> None:
    card.port.receive(b"P1..8191=P1+1" * 12 + b"P1\r")
    done = []
    while not card.port.idle:
        card.sim.attend(card.port)
        done.append(p1(card))
    assert done[:12] == [*range(1, 13)]
    assert card.port.take_output() == b"12\r\x06"


def test_the_answers_of_a_long_line_are_the_same_as_those_of_short_ones(card: Wire) -> None:
    said = card.raw(b"I0..8191" * 5 + b"\r")
    assert said == (card.raw(RANGE)[:-1]) * 5 + b"\x06"


def test_an_error_ends_a_line_that_is_done_in_parts(card: Wire) -> None:
    assert card.raw(b"P1..8191=P1+1P1..8191=P1+1CLEAR P1=7\r") == b"\x07ERR005\r"
    assert p1(card) == 2


def test_control_x_ends_a_line_that_is_done_in_parts(card: Wire) -> None:
    card.port.receive(b"P1..8191=P1+1" * 12 + b"\r")
    card.sim.attend(card.port)
    assert card.raw(b"\x18P0\r") == b"0\r\x06"
    assert p1(card) == 1


def test_a_program_that_is_listed_counts_with_its_lines(card: Wire) -> None:
    card.tell("OPEN PROG 1 CLEAR", *("X1" for _ in range(600)), "CLOSE")
    card.sim.wait(20 * CYCLE_S)
    card.port.receive(b"LIST PROG 1\r" * 100)
    assert answers(card, 90).count(b"\x06") <= 15


@pytest.mark.parametrize(("sent", "said"), [(b"\x19", b"P0..1000"), (b"\x0e", b"\0")])
def test_questions_about_the_line_itself_have_a_share_too(card: Wire, sent: bytes, said: bytes) -> None:
    card.raw(b"P0..1000\r")
    card.sim.wait(20 * CYCLE_S)
    card.port.receive(sent * 60_000)
    card.sim.attend(card.port)
    assert 0 < card.port.take_output().count(said) < 1000


def test_a_line_that_is_repeated_thousands_of_times_is_a_line_each_time(card: Wire) -> None:
    card.raw(b"P1=P1+1\r")
    card.port.receive(b"\t" * 60_000)
    card.sim.attend(card.port)
    assert p1(card) == 1 + LINES_PER_TURN


@pytest.mark.parametrize(("stop", "closed"), [(b"\x01", True), (b"\x0b", False)])
def test_a_stop_behind_half_a_megabyte_of_heavy_lines_acts_at_once(card: Wire, stop: bytes, closed: bool) -> None:
    card.tell("I200=1", "#2J/", "#2J+")
    card.sim.wait(0.5)
    card.port.receive(RANGE * 60_000 + stop)
    assert not card.port.crowded
    card.sim.attend(card.port)
    motor = card.card.motors[2]
    assert (motor.enabled, motor.jog.aborting) == (closed, closed)


def test_control_x_behind_half_a_megabyte_of_heavy_lines_empties_the_queue(card: Wire) -> None:
    card.port.receive(RANGE * 60_000)
    card.sim.attend(card.port)
    card.port.receive(b"\x18P1\r")
    card.sim.attend(card.port)
    assert card.port.take_output() == b"0\r\x06"
    assert card.port.idle
