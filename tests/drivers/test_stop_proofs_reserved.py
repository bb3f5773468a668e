"""Stops on a connection of their own, proven: each comes while a question waits for its answer on the other."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from drivers.commissioning.proofs.bench import ProofRig
from drivers.commissioning.proofs.stopping import MeasuredStops, prove_stops
from drivers.commissioning.stop_record import needed_stops
from drivers.commissioning.verification import verify
from drivers.lathe.stop import ABORT_ALL, KILL_ALL, StopPath
from drivers.link.base import StopWay
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.findings import Severity
from profiles.store import load_machine

CONTROL = ABORT_ALL + KILL_ALL
MACHINE = load_machine("turbo-ethernet-lathe").machine


@dataclass(kw_only=True)
class Board:
    """Two connections to one card. `waiting` is what was asked on the first when each stop came on the second."""

    lines: Port
    stops: Port
    obeys: bool = True
    keeps_apart: bool = True
    asked: bytes = b""
    said: bytes = b""
    waiting: list[bytes] = field(default_factory=list)

    def receive(self, data: bytes) -> None:
        self.asked, self.said = data, self.said + data
        self.lines.receive(data)

    def take_output(self) -> bytes:
        answer = self.lines.take_output()
        if answer and not self.keeps_apart and self.asked == b"P0..99\r":
            return b"0\r\x06" + answer
        self.asked = b"" if answer else self.asked
        return answer

    def press(self, data: bytes) -> None:
        self.waiting.append(self.asked)
        if self.obeys:
            self.stops.receive(data)
            self.stops.take_output()


class TwoConnections(MemoryLink):
    stop_way = StopWay.RESERVED

    def __init__(self, board: Board, sim: SimulatedLathe) -> None:
        super().__init__(board, sim)
        self._board = board

    def send_urgent(self, data: bytes) -> None:
        self._board.press(data)


def measured(*, obeys: bool = True, keeps_apart: bool = True) -> tuple[Board, MeasuredStops]:
    sim = SimulatedLathe(MACHINE)
    board = Board(lines=sim.connect(), stops=sim.connect(), obeys=obeys, keeps_apart=keeps_apart)
    link = TwoConnections(board, sim)
    client = PmacClient(link, sim)
    client.connect()
    judged = verify(client, MACHINE, client.dialect).judged
    found = prove_stops(ProofRig(client=client, stop=StopPath(link), clock=sim, judged=judged))
    sim.wait(1.0)
    assert not any(motor.jogging for motor in sim.controller.motors.values())
    return board, found


def test_every_stop_is_proven_past_a_question_that_waits() -> None:
    board, found = measured()
    assert {(e.way, e.origin, e.axis) for e in found.entries} == needed_stops(MACHINE)
    assert board.waiting == [b"P0..99\r"] * 4, "control-A and control-K, out of a jog and out of a cut"
    assert not set(CONTROL) & set(board.said)


@pytest.mark.parametrize(("obeys", "keeps_apart"), [(False, True), (True, False)])
def test_a_board_that_does_not_obey_there_or_mixes_up_its_answers_is_found(obeys: bool, keeps_apart: bool) -> None:
    """What does not obey is ended by its lease."""
    _, found = measured(obeys=obeys, keeps_apart=keeps_apart)
    failed = [check.code for check in found.checks if check.severity is Severity.REFUSAL]
    assert failed == ["proof_stop_abort_jog"]
