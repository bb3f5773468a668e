"""A host that floods the simulator, in real processes and sockets: others are heard, and so are signals."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

FLOOD = b"P0..1000\r" * 20_000
"""180 kB of lines, half a minute of work if they were all done at once."""

IN_FULL_FLOOD = 500_000
"""Bytes of answers: more than the sockets between the two hold."""

PATIENCE_S = 5.0
"""A host that had to wait for the whole flood would wait for ever."""


@contextmanager
def flooded(serve: Serve) -> Iterator[Served]:
    """A simulator with one host that sends without an end and reads what comes."""
    with serve("--tcp", "127.0.0.1:0") as served, socket.create_connection(served.tcp, timeout=10) as raving:
        flooding = threading.Event()
        writer = threading.Thread(target=_send_for_ever, args=(raving,))
        reader = threading.Thread(target=_read_for_ever, args=(raving, flooding))
        writer.start()
        reader.start()
        try:
            assert flooding.wait(30)
            yield served
        finally:
            served.process.kill()
            writer.join(10)
            reader.join(10)


def _send_for_ever(connected: socket.socket) -> None:
    with suppress(OSError):
        while True:
            connected.sendall(FLOOD)


def _read_for_ever(connected: socket.socket, flooding: threading.Event) -> None:
    read = 0
    with suppress(OSError):
        while data := connected.recv(65_536):
            read += len(data)
            if read > IN_FULL_FLOOD:
                flooding.set()


def read_until(connected: socket.socket, end: bytes) -> bytes:
    data = b""
    while not data.endswith(end):
        more = connected.recv(4096)
        assert more, "the simulator closed the connection"
        data += more
    return data


def test_another_host_is_answered_and_a_signal_ends_it_during_a_flood(serve: Serve) -> None:
    with flooded(serve) as served:
        with socket.create_connection(served.tcp, timeout=PATIENCE_S) as host:
            host.sendall(b"\x18\rI3=2 I6=1\r")
            read_until(host, b"\x06")
            for _ in range(10):
                host.sendall(b"P1\r")
                assert read_until(host, b"\x06") == b"0\r\x06"
        assert served.end() == (0, "", "")
