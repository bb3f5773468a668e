"""A host that floods the simulator, in real processes and sockets: others are heard, and so are signals."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

FLOOD = b"P0..1000\r" * 20_000
"""180 kB of lines, half a minute of work if they were all done at once."""

IN_FULL_FLOOD = 500_000
"""Bytes of answers: more than the sockets between the two hold."""

ANSWERS_TO_A_FLOOD = 20_000 * 2002
"""Bytes: a line of 1001 zeros each, and more. A host that had to wait for the other's lines would see them all go
by, for ever; how long it waits in time is the machine's."""


@dataclass
class Raving:
    """The host that floods: whether it does, and how many bytes of answers it has had."""

    flooding: threading.Event = field(default_factory=threading.Event)
    answered: int = 0


@contextmanager
def flooded(serve: Serve) -> Iterator[tuple[Served, Raving]]:
    """A simulator with one host that sends without an end and reads what comes."""
    with serve("--tcp", "127.0.0.1:0") as served, socket.create_connection(served.tcp, timeout=10) as raving:
        host = Raving()
        writer = threading.Thread(target=_send_for_ever, args=(raving,))
        reader = threading.Thread(target=_read_for_ever, args=(raving, host))
        writer.start()
        reader.start()
        try:
            assert host.flooding.wait(30)
            yield served, host
        finally:
            served.process.kill()
            writer.join(10)
            reader.join(10)


def _send_for_ever(connected: socket.socket) -> None:
    with suppress(OSError):
        while True:
            connected.sendall(FLOOD)


def _read_for_ever(connected: socket.socket, host: Raving) -> None:
    with suppress(OSError):
        while data := connected.recv(65_536):
            host.answered += len(data)
            if host.answered > IN_FULL_FLOOD:
                host.flooding.set()


def read_until(connected: socket.socket, end: bytes) -> bytes:
    data = b""
    while not data.endswith(end):
        more = connected.recv(4096)
        assert more, "the simulator closed the connection"
        data += more
    return data


def test_another_host_is_answered_and_a_signal_ends_it_during_a_flood(serve: Serve) -> None:
    with flooded(serve) as (served, raving):
        with socket.create_connection(served.tcp) as host:
            host.sendall(b"\x18\rI3=2 I6=1\r")
            read_until(host, b"\x06")
            for _ in range(10):
                before = raving.answered
                host.sendall(b"P1\r")
                assert read_until(host, b"\x06") == b"0\r\x06"
                assert raving.answered - before < ANSWERS_TO_A_FLOOD
        assert served.end() == (0, "", "")
