"""`console simulator` as other programs meet it: a real process, a real port, plain sockets."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

from drivers.clock import RealClock
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.address import TcpAddress
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient
from profiles.store import load_machine

if TYPE_CHECKING:
    from tests.system.conftest import Serve

pytestmark = pytest.mark.system

# Prog. 1 of the paper as a stranger would mend it: P400 in ms, the last move away from the part, M26 as a flag.
MENDED = """\
P100=1000 ;1000rpm set
P200=2500 ;Rotary encoder pulse
P300=10000/6 ;1/6 회전
P400=1000/(2*50) ;50Hz
P500= 275
close
OPEN PROG 1
CLEAR
INC
M26=0
ta10 ts10 f50000
x500 ;절삭깊이 0.1mm
WHILE(M26=0)
P1=((P100*P200)/60*4) F(P1) Y(P300) tm(P400) X(P500) ;
P1=((P100*P200)/60*4) F(P1) Y(P300) tm(P400) X(-P500) ;
ENDW
ta10 ts10 f50000 x-10000
CLOSE
"""


@dataclass
class Host:
    """A plain socket that types lines and reads replies."""

    socket: socket.socket
    kept: bytes = b""

    def ask(self, line: str) -> bytes:
        """Send one line, return everything up to its ACK, or up to the CR behind its BELL."""
        self.socket.sendall(line.encode("utf-8") + b"\r")
        while True:
            if end := self._end():
                reply, self.kept = self.kept[:end], self.kept[end:]
                return reply
            data = self.socket.recv(4096)
            assert data, "the simulator closed the connection"
            self.kept += data

    def _end(self) -> int:
        for index, byte in enumerate(self.kept):
            if byte == 0x06:
                return index + 1
            if byte == 0x07:
                return self.kept.find(b"\r", index) + 1
        return 0

    def number(self, line: str) -> float:
        return float(self.ask(line).rstrip(b"\x06"))


@pytest.fixture(scope="module")
def address(serve: Serve) -> Iterator[tuple[str, int]]:
    with serve("--tcp", "127.0.0.1:0") as served:
        yield served.tcp
        assert served.end() == (0, "", "")


@pytest.fixture
def host(address: tuple[str, int]) -> Iterator[Host]:
    with socket.create_connection(address, timeout=10) as connected:
        typed = Host(connected)
        connected.sendall(b"\x18")
        assert typed.ask("I3=2 I6=1").endswith(b"\x06")
        yield typed


def wait_until(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_the_mended_program_typed_line_by_line_runs_and_can_be_watched(host: Host) -> None:
    for motor in (1, 2, 3):
        assert host.ask(f"#{motor}J/") == b"\x06"
    for line in MENDED.splitlines():
        assert host.ask(line) == b"\x06", line
    assert host.ask("&1B1R") == b"\x06"
    wait_until(lambda: host.number("#2P") > 5000)
    positions, velocities, errors, spindle = [], [], [], []
    watched_until = host.number("#2P") + 50_000  # 0.6 s, 15 periods of the tool
    turned = 0.0
    while turned < watched_until:
        reply = host.ask("#1PVF#2VP").rstrip(b"\x06").split(b"\r")
        positions.append(float(reply[0]))
        velocities.append(float(reply[1]))
        errors.append(float(reply[2]))
        spindle.append(float(reply[3]))
        turned = float(reply[4])
    # 20 ms segments: 500 rpm, 83.3 counts/ms, 36.9 counts in a servo cycle. Two thirds of 275 counts: 183.
    assert sum(spindle) / len(spindle) == pytest.approx(10_000 * 500 / 60_000 * 0.44271, abs=0.2)
    assert max(positions) - min(positions) == pytest.approx(183.3, abs=8)
    assert max(map(abs, velocities)) > 1
    assert max(map(abs, errors)) > 10
    assert host.ask("M26=1") == b"\x06"
    wait_until(lambda: not int(host.ask("&1??")[5:6], 16) & 1)
    wait_until(lambda: host.number("#1P") < -9000)


def test_two_hosts_have_their_own_addressing_and_one_that_raves_harms_nobody(
    host: Host, address: tuple[str, int]
) -> None:
    assert host.ask("#2") == b"\x06"
    with socket.create_connection(address, timeout=10) as other:
        other.sendall(b"#1\r" + bytes(range(256)) * 50 + b"\rOPEN PROG 9\rX10")
    assert host.ask("#") == b"2\r\x06"
    assert host.ask("P5=7 P5") == b"7\r\x06"
    wait_until(lambda: host.ask("OPEN PROG 8") == b"\x06")
    assert host.ask("CLOSE") == b"\x06"


def test_a_line_that_is_wrong_is_refused_with_its_number(host: Host) -> None:
    assert host.ask("UUU") == b"\x07ERR003\r"
    assert host.ask("X1000") == b"\x07ERR005\r"
    assert host.ask("P7=1") == b"\x06"
    assert host.ask("P7=2 P7 NONSENSE") == b"\x07ERR003\r"
    assert host.ask("P7") == b"1\r\x06"


def test_our_own_client_connects_like_anybody_else(address: tuple[str, int]) -> None:
    link = TcpLink(TcpAddress(host=address[0], port=address[1]))
    client = PmacClient(link, RealClock())
    version, kind = client.connect()
    assert "PMAC" in kind
    assert float(version) > 1
    client.request("P10..12=3")
    assert client.numbers("P10", "P11", "P12") == (3, 3, 3)
    link.close()


def test_the_lathe_is_verified_homed_and_stopped_over_the_wire(address: tuple[str, int]) -> None:
    link = TcpLink(TcpAddress(host=address[0], port=address[1]))
    stop = StopPath(link)
    lathe = Lathe(PmacClient(link, RealClock()), load_machine("lee-2001-lathe").machine, RealClock(), stop)
    lathe.connect()
    assert lathe.verify() == ()
    lathe.enable()
    lathe.home()
    lathe.jog_to(AxisName.SPINDLE, 1234.0)
    assert lathe.snapshot().homed
    threading.Timer(0.3, stop.stop, ("operator",)).start()
    with pytest.raises(StoppedError, match="operator"):
        lathe.jog_to(AxisName.CARRIAGE, 150_000.0)
    snapshot = lathe.wait_for_rest()
    assert snapshot.at_rest
    assert snapshot.loops_closed
    assert 0 < snapshot.carriage.position < 100_000
    link.close()
