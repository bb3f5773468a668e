"""Faults as a client of the Ethernet board meets them: its replies are frames, and the empty queue is a NUL."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial

import pytest

from drivers.simulator.hosts.connection import Connection, PlainStream
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.test_connections import GETRESPONSE, Hall, Network, pass_time
from tests.drivers.wire_board import CYCLE_S, BoardWire, wire_board


@pytest.fixture
def board(machine: MachineProfile) -> BoardWire:
    made = wire_board(machine)
    assert made.response(b"I6=1 I3=2 P1=25 P2=50") == b"\x06"
    return made


@pytest.mark.parametrize(
    ("fault", "reply"),
    [("dropped-ack", b"25\r50\r"), ("extra-line", b"\r25\r50\r\x06"), ("nul", b"\0"), ("bare-bel", b"\x07")],
)
def test_a_spoiled_reply_byte_by_byte(board: BoardWire, fault: str, reply: bytes) -> None:
    board.sim.faults.inject(fault, replies=1)
    assert board.response(b"P1P2") == reply
    assert board.response(b"P1P2") == b"25\r50\r\x06"


def test_a_reply_leaves_in_pieces(board: BoardWire) -> None:
    board.sim.faults.inject("split-segments", gap_ms=20)
    replies = board.raw(GETRESPONSE[:-1] + b"\x04P1P2")
    assert replies == [b"25\r"]
    board.sim.wait(0.021)
    board.sim.wait(CYCLE_S)
    assert board.session.turn() == [b"50\r\x06"]


def test_a_late_reply_is_no_empty_queue(board: BoardWire) -> None:
    """A board that has nothing to say answers a NUL; one whose reply is late says nothing yet."""
    board.sim.faults.inject("late-reply", delay_ms=300)
    before_s = board.sim.now_s()
    assert board.response(b"P1") == b"25\r\x06"
    assert 0.3 <= board.sim.now_s() - before_s < 0.32


def test_a_hanging_card_has_a_silent_board_and_reads_afterwards(board: BoardWire) -> None:
    board.sim.faults.inject("hang", for_s=0.2)
    board.session.receive(GETRESPONSE + b"P1")
    for _ in range(30):
        board.sim.wait(CYCLE_S)
        assert board.session.turn() == []
        assert not board.session.busy
    board.sim.wait(0.1)
    assert board.raw(b"") == [b"25\r\x06"]


def test_a_slow_line_takes_a_millisecond_a_character(board: BoardWire) -> None:
    board.sim.faults.inject("9600-baud")
    before_s = board.sim.now_s()
    board.session.receive(GETRESPONSE + b"P1")
    said = b""
    while not said.endswith(b"\x06"):
        board.sim.wait(CYCLE_S)
        said += b"".join(board.session.turn())
    assert said == b"25\r\x06"
    # Ten characters there and four back.
    assert board.sim.now_s() - before_s == pytest.approx(14 / 960, abs=3 * CYCLE_S)


@pytest.mark.parametrize(
    "discipline", [PlainStream, partial(EthernetSession, board=Board())], ids=["plain", "board"]
)
def test_a_cut_cable_resets_the_connection_and_every_new_one_until_it_is_mended(
    machine: MachineProfile, discipline: Callable[..., PlainStream]
) -> None:
    async def scene() -> None:
        hall = Hall(SimulatedLathe(machine))
        network, late, mended = Network(), Network(), Network()
        hall.enter(discipline, network)
        hall.lathe.faults.inject("cut-cable", for_s=0.1)
        await pass_time(hall, 1)
        assert (network.ended, len(hall.hosts)) == ("aborted", 0)
        hall.enter(discipline, late)
        assert late.ended == "aborted"
        await pass_time(hall, 21)
        assert isinstance(hall.enter(discipline, mended), Connection)
        assert mended.ended == ""
        assert hall.lathe.faults.active() == ()

    asyncio.run(scene())


def test_a_power_cycle_resets_the_connections_of_a_board_and_leaves_a_serial_line(machine: MachineProfile) -> None:
    async def scene() -> None:
        hall = Hall(SimulatedLathe(machine))
        serial, board = Network(), Network()
        host = hall.plain(serial)
        hall.ethernet(board)
        hall.lathe.power_cycle()
        await pass_time(hall, 1)
        assert (serial.ended, board.ended) == ("", "aborted")
        host.data_received(b"I3=2\r")
        assert serial.sent == [b"\x06"]

    asyncio.run(scene())
