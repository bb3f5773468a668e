"""Hosts of the control socket: they neither flood the machine nor fill its memory."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress
from pathlib import Path

import pytest

from drivers.simulator.hosts.control_address import UnixAddress
from drivers.simulator.hosts.control_socket import LINES_A_TURN, ControlHost, listen_for_control
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.test_connections import Network


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
