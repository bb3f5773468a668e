"""`console simulator` at every kind of address at once: a real process, plain sockets and a serial line."""

from __future__ import annotations

import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from drivers.clock import RealClock
from drivers.link.address import SerialAddress
from drivers.link.serial import SerialLink
from drivers.pmac.client import PmacClient
from tests.preloaded import Preloaded, completed

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

ALL = ("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0", "--pty")
TIMEOUT_S = 10.0
FETCH = bytes((0xC0, 0xC5, 0, 0, 0, 0, 0x08, 0))


@contextmanager
def connected(address: tuple[str, int]) -> Iterator[socket.socket]:
    with socket.create_connection(address, timeout=TIMEOUT_S) as host:
        yield host


def get_response(line: bytes) -> bytes:
    return struct.pack(">BBHHH", 0x40, 0xBF, 0, 0, len(line)) + line


def ask(board: socket.socket, line: bytes) -> bytes:
    """Send a line to the Ethernet board as clients do, who take one look into the socket for one reply."""
    board.sendall(get_response(line))
    reply = board.recv(2048)
    while reply[-1:] not in (b"\x06", b"\r", b"\0"):
        board.sendall(FETCH)
        reply += board.recv(2048)
    return reply


def typed(stream: socket.socket, line: bytes) -> bytes:
    """Type a line on the ASCII stream and read up to its ACK or error."""
    stream.sendall(line + b"\r")
    reply = b""
    while not re.search(rb"\x06|\x07[^\r]*\r", reply):
        data = stream.recv(2048)
        assert data, "the simulator closed the connection"
        reply += data
    return reply


@pytest.fixture(scope="module")
def served(serve: Serve) -> Iterator[Served]:
    with serve(*ALL) as running:
        yield running
        assert running.end() == (0, "", "")


def test_one_machine_is_met_at_all_addresses_and_each_has_a_line_of_its_own(served: Served) -> None:
    kinds = [str(line["listening"]).partition(":")[0] for line in served.said]
    assert kinds == ["tcp", "ethernet", "serial"]
    assert {(line["machine"], line["simulated"]) for line in served.said} == {("lee-2001-lathe", True)}
    link = SerialLink(SerialAddress(device=served.device))
    serial = PmacClient(link, RealClock())
    serial.connect()
    with connected(served.tcp) as stream, connected(served.ethernet) as board:
        assert ask(board, b"P5=25") == b"\x06"
        assert typed(stream, b"P5 P6=26") == b"25\r\x06"
        assert serial.numbers("P5", "P6") == (25, 26)
        serial.request("#3")
        assert ask(board, b"#2#") == b"2\r\x06"
        assert typed(stream, b"#") == b"1\r\x06"
        assert serial.query("#") == ("3",)
    link.close()


def test_a_client_that_begins_with_the_handshake_and_the_version_in_one_line_is_served(served: Served) -> None:
    with connected(served.ethernet) as board:
        version = ask(board, b"i6=1 i3=2 ver").decode()
        assert re.fullmatch(r"\d+\.\d+\s*\r\x06", version)
        assert ask(board, b"UUU") == b"\x07ERR003\r"
        # 1001 values of three bytes: two pieces of 1400 bytes, which end inside a value, and the rest.
        assert ask(board, b"P0..1000=42") == b"\x06"
        assert ask(board, b"P0..1000") == b"42\r" * 1001 + b"\x06"
        assert ask(board, b"P0..1000=0") == b"\x06"


def test_a_client_that_drains_before_each_line_and_ends_it_with_cr_and_lf_is_served(served: Served) -> None:
    with connected(served.tcp) as stream:
        assert typed(stream, b"i6=1 i3=2") == b"\x06"
        for line, reply in (
            (b"ver\r\n", rb"\d+\.\d+\s*\r\x06"),
            (b"#1?PVF\r\n", rb"[0-9A-F]{12}\r(-?[\d.]+\r){3}\x06"),
        ):
            stream.sendall(line)
            assert re.fullmatch(reply, stream.recv(4096))


def test_clients_that_rave_stall_or_die_harm_nobody(served: Served) -> None:
    with connected(served.ethernet) as good, connected(served.tcp) as stream:
        assert ask(good, b"I6=1 I3=2") == b"\x06"
        with connected(served.ethernet) as raving, connected(served.tcp) as garbled:
            with suppress(ConnectionError):
                raving.sendall(get_response(b"P1") + bytes(range(256)) * 200)
                while raving.recv(2048):
                    pass  # its connection is closed
            garbled.sendall(bytes(range(256)) * 200 + b"\rOPEN PROG 9\rX1")
            assert typed(stream, b"P7=1 P7") == b"1\r\x06"
        stalled = socket.create_connection(served.ethernet, timeout=TIMEOUT_S)
        half = socket.create_connection(served.ethernet, timeout=TIMEOUT_S)
        half.sendall(get_response(b"P0..1000")[:11])
        never = threading.Thread(target=_ask_for_ever, args=(stalled,))
        never.start()
        died = socket.create_connection(served.ethernet, timeout=TIMEOUT_S)
        assert ask(died, b"#2 OPEN PROG 9") in (b"\x06", b"\x07ERR007\r")
        died.sendall(get_response(b"P0..1000") * 20)
        died.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        died.close()  # a reset, as when the process is killed
        for number in range(60):
            assert ask(good, b"P8=%d P8" % number) == b"%d\r\x06" % number
            assert typed(stream, b"P8") == b"%d\r\x06" % number
        deadline = time.monotonic() + TIMEOUT_S
        while ask(good, b"OPEN PROG 9") != b"\x06":
            assert time.monotonic() < deadline
        assert ask(good, b"CLOSE") == b"\x06"
        half.close()
        with suppress(OSError):
            stalled.shutdown(socket.SHUT_RDWR)  # unless it has been cut off
        never.join(TIMEOUT_S)
        stalled.close()


def _ask_for_ever(client: socket.socket) -> None:
    """Never read a reply."""
    with suppress(OSError):
        while True:
            client.sendall(get_response(b"P0..1000") * 100)


def test_four_clients_ask_at_once_and_each_gets_its_own_replies(served: Served) -> None:
    wrong: list[bytes] = []

    def poll(number: int) -> None:
        with connected(served.ethernet) as board:
            ask(board, b"#%d" % number)
            for turn in range(300):
                value = 1000 * number + turn
                reply = ask(board, b"P%d=%d P%d #" % (number, value, number))
                if reply != b"%d\r%d\r\x06" % (value, number):
                    wrong.append(reply)

    with connected(served.ethernet) as board:
        ask(board, b"I6=1 I3=2")  # of the card, whatever it was before
    threads = [threading.Thread(target=poll, args=(number,)) for number in range(1, 5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert wrong == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_it_cleanly_while_clients_are_connected(serve: Serve, number: signal.Signals) -> None:
    with serve(*ALL) as running, connected(running.ethernet) as board, connected(running.tcp):
        board.sendall(get_response(b"P0..1000") * 50)
        assert running.end(number) == (0, "", "")


def test_time_runs_as_fast_as_it_is_told(serve: Serve) -> None:
    """100 rpm are 16.667 counts a ms; on a machine with other work some of the twenty times are lost."""
    with serve("--ethernet", "127.0.0.1:0", "--speed", "20") as running, connected(running.ethernet) as board:
        ask(board, b"I6=1 I3=2 #2J/ J+")
        while float(ask(board, b"#2P")[:-2]) < 100_000:
            pass
        began, first = time.monotonic(), float(ask(board, b"#2P")[:-2])
        while (last := float(ask(board, b"#2P")[:-2])) < first + 300_000:
            pass
        rate = (last - first) / (time.monotonic() - began) / 1000
        assert 4 * 16.667 < rate < 21 * 16.667
        assert running.end() == (0, "", "")


@pytest.mark.parametrize(("dialect", "turbo"), [("turbo", True), ("pmac", False)])
def test_the_controller_is_of_the_family_that_is_asked_for(serve: Serve, dialect: str, turbo: bool) -> None:
    with serve("--ethernet", "127.0.0.1:0", "--dialect", dialect) as running, connected(running.ethernet) as board:
        ask(board, b"I6=1 I3=2")
        assert (b"TURBO" in ask(board, b"TYPE")) == turbo
        # The words of a coordinate system: two of 24 bits, and a third one in the Turbo family.
        assert len(ask(board, b"&1??")) == (18 if turbo else 12) + len(b"\r\x06")
        assert running.end() == (0, "", "")


@pytest.mark.parametrize("kind", ["tcp", "ethernet"])
def test_an_address_in_use_is_refused_and_nothing_listens(kind: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        done = completed(["simulator", "--pty", f"--{kind}", where], 30.0)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"{kind}:{where}" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_people_read_a_line_for_each_address() -> None:
    with Preloaded(
        [sys.executable, "-m", "console", "simulator", "--pty", "--ethernet", "127.0.0.1:0"],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(2)]
        process.terminate()
        assert process.wait(TIMEOUT_S) == 0
    assert re.fullmatch(r"SIM  lee-2001-lathe .* ethernet:127\.0\.0\.1:\d+\n", lines[0])
    assert re.fullmatch(r"SIM  lee-2001-lathe .* serial:/\S+/trilobe-\w+/pmac\n", lines[1])


def test_what_was_saved_outlives_the_power(serve: Serve, tmp_path: Path) -> None:
    flash = tmp_path / "card.json"
    words = ("--tcp", "127.0.0.1:0", "--saved", str(flash))
    with serve(*words) as running, connected(running.tcp) as host:
        typed(host, b"I3=2 I6=1")
        assert typed(host, b"I122=77 P7=5") == b"\x06"
        assert typed(host, b"SAVE") == b"\x06"
        assert typed(host, b"I122=78") == b"\x06"
        running.process.kill()
        running.process.wait(TIMEOUT_S)
    with serve(*words) as running, connected(running.tcp) as host:
        assert typed(host, b"I3 I6 I122 P7") == b"2\r1\r77\r0\r\x06"
        assert running.end() == (0, "", "")


# A host that floods the simulator, in real processes and sockets: others are heard, and so are signals.


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
