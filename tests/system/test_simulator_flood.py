"""A host that floods the simulator, in real processes and sockets: others are heard, and so are signals."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

pytestmark = pytest.mark.system

FLOOD = b"P0..1000\r" * 20_000
"""180 kB of lines, some seconds of work if they were all done at once."""


PATIENCE_S = 5.0
"""A host that had to wait for the whole flood would wait for ever."""


@contextmanager
def flooded() -> Iterator[tuple[subprocess.Popen[str], tuple[str, int]]]:
    """A simulator with one host that sends without an end and reads what comes."""
    with subprocess.Popen(
        [sys.executable, "-m", "console", "simulator", "--tcp", "127.0.0.1:0", "--json"],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        text = ""
        while not text.endswith("}\n"):
            text += process.stdout.readline()
        _, name, port = json.loads(text)["listening"].split(":")
        with socket.create_connection((name, int(port)), timeout=10) as raving:
            writer = threading.Thread(target=_send_for_ever, args=(raving,))
            reader = threading.Thread(target=_read_for_ever, args=(raving,))
            writer.start()
            reader.start()
            time.sleep(1.0)  # a flood in real time, as the simulator's own clock runs
            try:
                yield process, (name, int(port))
            finally:
                process.kill()
                writer.join(10)
                reader.join(10)


def _send_for_ever(connected: socket.socket) -> None:
    with suppress(OSError):
        while True:
            connected.sendall(FLOOD)


def _read_for_ever(connected: socket.socket) -> None:
    with suppress(OSError):
        while connected.recv(65_536):
            pass


def test_another_host_is_answered_and_a_signal_ends_it_during_a_flood() -> None:
    with flooded() as (process, address):
        with socket.create_connection(address, timeout=10) as host:
            host.sendall(b"\x18\rI3=2 I6=1\r")
            time.sleep(0.3)
            host.recv(4096)
            host.settimeout(PATIENCE_S)
            for _ in range(10):
                host.sendall(b"P1\r")
                assert host.recv(4096) == b"0\r\x06"
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=PATIENCE_S) == 0
