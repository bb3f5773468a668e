"""Hosts on sockets, and who speaks to the control socket."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, closing, suppress
from functools import partial
from pathlib import Path

import pytest

from drivers.simulator.hosts.connection import SLOW_READER, UNREAD_LIMIT, Begin, HostConnection, PlainStream
from drivers.simulator.hosts.control_address import UnixAddress
from drivers.simulator.hosts.control_socket import LINES_A_TURN, ControlHost, listen_for_control
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.hosts.port import INBOX_LIMIT
from drivers.simulator.hosts.real_time import Host
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.conftest import Bench

CYCLE_S = 0.005
"""A little more than one background cycle of the bundled machine, 11 x 443 us."""

GETRESPONSE = bytes.fromhex("40bf000000000002")


class Network(asyncio.Transport):
    """The transport of a connected host, as far as a connection uses it."""

    def __init__(self, unread: int = 0) -> None:
        super().__init__()
        self.reading = True
        self.sent: list[bytes] = []
        self.unread = unread
        self.ended = ""

    def is_reading(self) -> bool:
        return self.reading

    def pause_reading(self) -> None:
        self.reading = False

    def resume_reading(self) -> None:
        self.reading = True

    def is_closing(self) -> bool:
        return bool(self.ended)

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.sent.append(bytes(data))

    def get_write_buffer_size(self) -> int:
        return self.unread

    def close(self) -> None:
        self.ended = "closed"

    def abort(self) -> None:
        self.ended = "aborted"


class Counted(PlainStream):
    """Counts the turns that its hosts have had."""

    turns = 0

    def turn(self) -> list[bytes]:
        Counted.turns += 1
        return super().turn()


class Hall:
    """A card with hosts that come and go."""

    def __init__(self, lathe: SimulatedLathe) -> None:
        self.lathe = lathe
        self.hosts: set[Host] = set()
        self.board = Board()

    def plain(self, network: Network) -> HostConnection:
        return self.enter(PlainStream, network)

    def ethernet(self, network: Network) -> HostConnection:
        return self.enter(partial(EthernetSession, board=self.board), network)

    def enter(self, discipline: Begin, network: Network) -> HostConnection:
        connection = HostConnection(self.lathe, self.hosts, discipline)
        connection.connection_made(network)
        return connection


Scene = Callable[[Hall], Awaitable[None]]


def play(bench: Bench, scene: Scene) -> None:
    """Play a scene in an event loop, with a card in the handshake that clients use."""

    async def run() -> None:
        await scene(Hall(bench.sim))

    asyncio.run(run())


async def pass_time(hall: Hall, cycles: int) -> None:
    """Let background cycles pass, and flush the hosts as the servers do."""
    for _ in range(cycles):
        hall.lathe.wait(CYCLE_S)
        for host in tuple(hall.hosts):
            host.flush()
        await rounds(20)


async def rounds(number: int) -> None:
    """Let everybody have this many turns."""
    for _ in range(number):
        await asyncio.sleep(0)


def test_a_line_is_answered_as_it_comes_and_no_time_passes(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        plain, board = Network(), Network()
        hall.plain(plain).data_received(b"P1=7 P1\r#2")
        hall.ethernet(board).data_received(GETRESPONSE + b"P1" + GETRESPONSE[:5])
        assert (plain.sent, board.sent) == ([b"7\r\x06"], [b"7\r\x06"])

    before = bench.sim.controller.cycles
    play(bench, scene)
    assert bench.sim.controller.cycles == before


@pytest.mark.parametrize("stop", [b"\x01", b"\x0b"])
def test_a_stop_acts_as_it_comes(closed: Bench, stop: bytes) -> None:
    motor = closed.sim.controller.motors[3]
    closed.client.request("#3J+")
    closed.sim.wait(1.0)

    async def scene(hall: Hall) -> None:
        hall.plain(Network()).data_received(b"P1..99\r" * 50 + stop)
        assert motor.jog.aborting if stop == b"\x01" else not motor.enabled

    play(closed, scene)


@pytest.mark.parametrize(("kind", "request_"), [("plain", b"P1\r"), ("ethernet", GETRESPONSE + b"P1")])
def test_a_host_that_asks_a_lot_lets_others_in_and_is_answered(bench: Bench, kind: str, request_: bytes) -> None:
    async def scene(hall: Hall) -> None:
        flooding, quick = Network(), Network()
        host = getattr(hall, kind)(flooding)
        host.data_received(request_ * 400)
        assert b"".join(flooding.sent).count(b"\x06") < 10
        hall.plain(quick).data_received(b"P1\r")
        assert quick.sent == [b"0\r\x06"]
        await rounds(200)
        assert b"".join(flooding.sent).count(b"\x06") > 50
        await pass_time(hall, 10)
        assert b"".join(flooding.sent) == b"0\r\x06" * 400

    play(bench, scene)


def test_a_host_that_has_had_its_share_of_a_cycle_is_not_looked_at_before_the_next(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        host = hall.enter(Counted, Network())
        host.data_received(b"P1\r" * 400)
        await rounds(200)
        turns = Counted.turns
        await rounds(200)
        assert Counted.turns == turns
        host.flush()
        assert Counted.turns == turns + 1

    play(bench, scene)


def test_nothing_is_written_to_a_host_whose_end_is_not_yet_told(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        network = Network()
        host = hall.ethernet(network)
        network.ended = "reset"
        for _ in range(5):
            host.data_received((GETRESPONSE + b"P1") * 10)
            await rounds(5)
        assert network.sent == []

    play(bench, scene)


def test_what_a_lost_host_left_is_not_executed_any_more(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        network = Network()
        host = hall.plain(network)
        host.data_received(b"P1=P1+1\r" * 400)
        host.connection_lost(None)
        said = len(network.sent)
        await rounds(200)
        assert len(network.sent) == said

    play(bench, scene)
    assert 0 < bench.number("P1") < 10


@pytest.mark.parametrize(("kind", "request_"), [("plain", b"P1\r"), ("ethernet", GETRESPONSE + b"P1")])
def test_a_host_that_ends_its_sending_is_answered_then_closed(bench: Bench, kind: str, request_: bytes) -> None:
    async def scene(hall: Hall) -> None:
        network = Network()
        host = getattr(hall, kind)(network)
        host.data_received(request_ * 400 + request_[:1])
        assert host.eof_received()
        ended = [network.ended]
        await pass_time(hall, 10)
        assert b"".join(network.sent) == b"0\r\x06" * 400
        assert [*ended, network.ended] == ["", "closed"]
        assert not hall.hosts
        host.connection_lost(None)

    ports = len(bench.sim._ports)
    play(bench, scene)
    assert len(bench.sim._ports) == ports


def test_a_host_that_has_nothing_left_to_ask_is_closed_at_once(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        network = Network()
        host = hall.plain(network)
        host.data_received(b"OPEN PROG 5\r")
        host.eof_received()
        assert (network.sent, network.ended) == ([b"\x06"], "closed")

    play(bench, scene)
    assert bench.sim.controller.open_buffer is None


def test_no_more_is_read_than_the_card_has_room_for(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        network = Network()
        host = hall.plain(network)
        host.data_received(b"P1=1\r" * (INBOX_LIMIT // 5))
        host.data_received(b"P1=1\r" * 100)
        reading = [network.reading]
        await pass_time(hall, 10)
        assert [*reading, network.reading] == [False, True]
        assert set(b"".join(network.sent)) == {6}

    play(bench, scene)


def test_a_host_that_does_not_read_its_answers_is_served_with_the_clock_only(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        network = Network(unread=SLOW_READER + 1)
        host = hall.plain(network)
        host.data_received(b"P1\r" * 100)
        await rounds(50)
        assert network.sent == []
        host.flush()
        await rounds(50)
        assert 0 < b"".join(network.sent).count(b"\x06") < 10
        assert (network.ended, network.reading) == ("", True)

    play(bench, scene)


@pytest.mark.parametrize("kind", ["plain", "ethernet"])
def test_a_host_that_reads_nothing_at_all_is_cut_off_and_forgotten(bench: Bench, kind: str) -> None:
    async def scene(hall: Hall) -> None:
        network = Network(unread=UNREAD_LIMIT + 1)
        host = getattr(hall, kind)(network)
        host.data_received(b"")
        assert host in hall.hosts
        host.flush()
        assert network.ended == "aborted"
        assert not hall.hosts
        host.connection_lost(None)
        host.flush()
        host.data_received(b"P1\r")
        await rounds(5)

    ports = len(bench.sim._ports)
    play(bench, scene)
    assert len(bench.sim._ports) == ports


def test_garbage_closes_its_own_connection_behind_the_answers_to_what_came_before(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        bad, good = Network(), Network()
        other = hall.ethernet(good)
        hall.ethernet(bad).data_received(GETRESPONSE + b"P1" + b"\xff" * 100)
        await rounds(5)
        assert (bad.sent, bad.ended) == ([b"0\r\x06"], "closed")
        assert hall.hosts == {other}
        other.data_received(GETRESPONSE + b"P1")
        assert (good.sent, good.ended) == ([b"0\r\x06"], "")

    play(bench, scene)


def test_a_buffer_that_a_lost_client_left_open_can_be_opened_by_others(bench: Bench) -> None:
    async def scene(hall: Hall) -> None:
        network, other = Network(), Network()
        host = hall.ethernet(network)
        line = b"OPEN PROG 5"
        host.data_received(GETRESPONSE[:-1] + bytes([len(line)]) + line)
        host.connection_lost(ConnectionResetError())
        hall.plain(other).data_received(b"OPEN PROG 6\r")
        assert other.sent == [b"\x06"]

    play(bench, scene)


def test_clients_that_ask_change_no_trajectory(closed: Bench, bench: Bench) -> None:
    """The same jogs, once alone and once with two clients that never stop asking: equal to the last bit."""
    bench.lathe.enable()
    alone, watched = closed.record(1), bench.record(1)

    def jogs(lathe: SimulatedLathe, look: Callable[[], None]) -> None:
        for line in (b"#1J^3000\r", b"#1J^-5000\r", b"#1J/\r"):
            port = lathe.connect()
            port.receive(line)
            for _ in range(40):
                look()
                lathe.wait(0.01)
            lathe.disconnect(port)

    async def scene(hall: Hall) -> None:
        plain, board = hall.plain(Network()), hall.ethernet(Network())

        def look() -> None:
            plain.data_received(b"#1PVF#2PVF I122 ???\r" * 3)
            board.data_received(GETRESPONSE + b"#1" + GETRESPONSE + b"??")

        jogs(hall.lathe, look)

    jogs(closed.sim, lambda: None)
    play(bench, scene)
    assert len(alone.positions) > 2000
    assert (watched.commands, watched.positions) == (alone.commands, alone.positions)


# The control socket: its hosts have turns, as those of the card.


class Channel(Network):
    """The transport of a control host."""

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        self.high = high

    @property
    def lines(self) -> list[str]:
        return b"".join(self.sent).decode().splitlines()


def scene(machine: MachineProfile, play: Callable[[ControlHost, Channel], object]) -> Channel:
    """Let a host do something, and then the loop have a hundred turns."""

    async def run() -> Channel:
        host, channel = ControlHost(SimulatedLathe(machine)), Channel()
        host.connection_made(channel)
        play(host, channel)
        for _ in range(100):
            await asyncio.sleep(0)
        return channel

    return asyncio.run(run())


def test_a_few_lines_a_turn_and_the_others_have_theirs(machine: MachineProfile) -> None:
    after_one: list[int] = []

    def play(host: ControlHost, channel: Channel) -> None:
        host.data_received(b"active\n" * 50)
        after_one.append(len(channel.lines))
        assert not channel.reading

    channel = scene(machine, play)
    assert after_one == [LINES_A_TURN]
    assert channel.lines == ["ok"] * 50
    assert channel.reading


def test_nothing_is_read_of_a_host_that_does_not_read_its_answers(machine: MachineProfile) -> None:
    def play(host: ControlHost, channel: Channel) -> None:
        assert channel.high == 65_536
        host.pause_writing()
        host.data_received(b"list\n" * 50)
        assert (channel.sent, channel.reading) == ([], False)

    assert scene(machine, play).sent == []

    def go_on(host: ControlHost, channel: Channel) -> None:
        play(host, channel)
        host.resume_writing()

    assert scene(machine, go_on).lines.count("ok") == 50


@pytest.mark.parametrize("length", [4097, 5_000_000])
def test_a_line_that_is_too_long_is_refused_and_the_next_is_answered(machine: MachineProfile, length: int) -> None:
    channel = scene(machine, lambda host, _: host.data_received(b"x" * length + b"\nactive\n"))
    assert channel.lines == ["refused: a line has at most 4096 bytes", "ok"]


def test_a_host_that_sends_no_more_is_closed_behind_its_answers(machine: MachineProfile) -> None:
    def play(host: ControlHost, channel: Channel) -> None:
        host.data_received(b"active\n" * 9 + b"active")
        assert host.eof_received()
        assert channel.ended == ""

    channel = scene(machine, play)
    assert (channel.lines, channel.ended) == (["ok"] * 10, "closed")


def test_a_path_whose_owner_hangs_is_taken(machine: MachineProfile, tmp_path: Path) -> None:
    """So many wait to be served that there is no room for another: it is not waited for, and not taken over."""
    path = str(tmp_path / "faults")
    with ExitStack() as opened:
        listening = opened.enter_context(closing(socket.socket(socket.AF_UNIX)))
        listening.bind(path)
        listening.listen(0)
        for _ in range(4):
            waiting = opened.enter_context(closing(socket.socket(socket.AF_UNIX)))
            waiting.setblocking(False)
            with suppress(BlockingIOError):
                waiting.connect(path)
        with pytest.raises(OSError, match="in use"):
            asyncio.run(listen_for_control(asyncio.Protocol, UnixAddress(path=path), opened))
    assert Path(path).is_socket()
