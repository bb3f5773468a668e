"""SAVE takes its seconds: what a card does meanwhile, what its hosts hear, and what a client makes of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from drivers.errors import ControllerError, LinkTimeoutError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.saving import LONGEST_SAVE_S, SAVE_S, SAVE_TIMEOUT_S, saves
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.wire_board import DOWN, wire_board
from tests.drivers.wire_card import CYCLE_S, Wire, wire

BOTH = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)


def say(card: Wire, line: bytes) -> bytes:
    """Send a line, and return what comes within the next background cycle."""
    card.port.receive(line + b"\r")
    card.sim.wait(2 * CYCLE_S)
    return card.port.take_output()


def test_the_seconds_are_within_what_manuals_and_clients_say() -> None:
    assert 3.0 < SAVE_S < 6.0, "twice the patience of a public client, once is not enough"
    assert SAVE_S < LONGEST_SAVE_S < SAVE_TIMEOUT_S


@BOTH
def test_for_its_seconds_the_card_answers_nobody_and_then_everybody(
    machine: MachineProfile, dialect: Dialect
) -> None:
    card = wire(machine, dialect)
    other = card.sim.connect()
    assert say(card, b"SAVE P1") == b""
    began_s = card.sim.now_s()
    other.receive(b"P2\r\x10")
    card.sim.wait(SAVE_S - 0.1)
    assert card.port.take_output() + other.take_output() == b""
    card.sim.wait(0.2)
    assert card.port.take_output() == b"0\r\x06"
    first, second = other.take_output().split(b"\r", 1)
    assert len(first.split()) == 8, "a control character comes before the lines"
    assert second == b"0\r\x06"
    assert 0.0 < card.sim.now_s() - began_s - SAVE_S < 0.2


def counted(card: Wire, number: int) -> float:
    return card.card.variables.get(VariableKind.P, number)


def test_servo_and_plc_0_continue_and_the_background_waits(machine: MachineProfile) -> None:
    card = wire(machine)
    card.tell("I5=3")
    for number in (0, 1):
        card.tell(f"OPEN PLC {number} CLEAR", f"P{number}=P{number}+1", "CLOSE", f"ENABLE PLC {number}")
    card.tell("#1J+")
    card.sim.wait(0.1)
    assert say(card, b"SAVE") == b""
    motor = card.card.motors[1]
    scans, interrupts, place = counted(card, 1), counted(card, 0), motor.position
    card.sim.wait(1.0)
    assert counted(card, 1) == scans
    assert counted(card, 0) > interrupts + 500
    assert abs(motor.position - place) > 1000.0
    card.sim.wait(SAVE_S)
    assert counted(card, 1) > scans


def test_a_stop_that_comes_meanwhile_waits_too(machine: MachineProfile) -> None:
    """The manuals: not while the machine is in operation."""
    card = wire(machine)
    card.tell("#1J+")
    assert say(card, b"SAVE") == b""
    card.port.receive(b"\x01")
    card.sim.wait(SAVE_S - 0.1)
    assert card.card.motors[1].velocity != 0.0
    card.sim.wait(2.0)
    assert card.card.motors[1].velocity == 0.0


def test_what_cannot_be_written_is_refused_at_once(machine: MachineProfile, tmp_path: Path) -> None:
    card = wire(machine, saved=tmp_path / "missing" / "saved.json")
    assert card.raw(b"SAVE\r") == b"\x07ERR006\r"


def test_a_client_of_the_board_gets_one_nul_and_no_acknowledgement_afterwards(machine: MachineProfile) -> None:
    board = wire_board(machine)
    assert board.response(b"I3=2 I6=1") == b"\x06"
    other = EthernetSession(board.sim, board.sim.connect(), Board())
    assert board.response(b"P1=7 SAVE") == b"\x00"
    assert board.response(b"P1") == b"7\r\x06"
    assert other.turn() == []


def test_a_client_of_the_board_that_polls_gets_nul_meanwhile_and_its_answer_afterwards(
    machine: MachineProfile,
) -> None:
    board = wire_board(machine)
    assert board.response(b"I3=2 I6=1") == b"\x06"
    begun_s = board.sim.now_s()
    assert board.ask(DOWN, 0xB0, b"P1=7 SAVE") == b"@"
    board.sim.wait(0.1)
    assert [board.fetched() for _ in range(3)] == [b"\x00"] * 3
    assert board.sim.now_s() - begun_s < 1.0
    assert board.response(b"P1") == b"7\r\x06"
    assert board.sim.now_s() - begun_s > 3.0


@dataclass(kw_only=True)
class BoardLine:
    """The end of a line at a board: over a SAVE it says NUL, at once or when the card is there again."""

    port: Port
    at_once: bool
    sent: bytes = b""
    _said: list[bytes] = field(default_factory=list)

    def receive(self, data: bytes) -> None:
        self.sent += data
        if b"SAVE" in data and self.at_once:
            self._said.append(b"\0")
        self.port.receive(data)

    def take_output(self) -> bytes:
        said = self.port.take_output()
        if said == b"\x06" and self.sent.endswith(b"SAVE\r"):
            said = b"" if self.at_once else b"\0"
        return self._said.pop(0) if self._said else said


@BOTH
@pytest.mark.parametrize("at_once", [False, True], ids=["after it", "at once"])
def test_a_nul_is_no_failure(machine: MachineProfile, dialect: Dialect, at_once: bool) -> None:
    sim = SimulatedLathe(machine, dialect=dialect)
    line = BoardLine(port=sim.connect(), at_once=at_once)
    client = PmacClient(MemoryLink(line, sim), sim)
    client.connect()
    faults = client.faults.total
    assert client.request("SAVE") == ()
    assert client.in_step
    assert client.faults.total == faults
    assert client.request("P1=3") == ()
    assert client.query("P1") == ("3",)
    assert line.sent.count(b"SAVE") == 1


@BOTH
def test_a_client_of_the_line_waits_for_the_acknowledgement(machine: MachineProfile, dialect: Dialect) -> None:
    sim = SimulatedLathe(machine, dialect=dialect)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    began_s = sim.now_s()
    assert client.request("SAVE", timeout_s=2.0) == ()
    assert SAVE_S <= sim.now_s() - began_s < SAVE_S + 0.1
    assert client.faults.total == 0


def test_a_refusal_and_a_card_that_stays_away_are_told(machine: MachineProfile) -> None:
    sim = SimulatedLathe(machine)
    line = BoardLine(port=sim.connect(), at_once=True)
    client = PmacClient(MemoryLink(line, sim), sim)
    client.connect()
    line.at_once = False
    with pytest.raises(ControllerError):
        client.request("SAVE XYZ=")
    line.at_once = True
    sim.lines.hung = True
    with pytest.raises(LinkTimeoutError) as lost:
        client.request("SAVE")
    assert lost.value.problems[0].code == "link.not_in_step"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("SAVE", True),
        ("p1=1 sa ve", True),
        ('CMD"SAVE"', False),
        ("P1 ; SAVE", False),
        ("SAVED", False),
        ("V", False),
    ],
)
def test_which_lines_save(line: str, expected: bool) -> None:
    assert saves(line) is expected
