"""Faults of a served simulator, asked for over its control socket: real sockets, a real serial line."""

from __future__ import annotations

import os
import re
import signal
import socket
import stat
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from drivers.clock import RealClock
from drivers.errors import LinkError, LinkTimeoutError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import StopPath, StoppedError
from drivers.link.address import SerialAddress, TcpAddress
from drivers.link.opening import TcpLink
from drivers.link.serial import SerialLink
from drivers.pmac.client import PmacClient
from drivers.simulator.hosts.process import SimulatorProcess
from profiles.store import BUNDLED_MACHINES, load_machine
from tests.preloaded import completed

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

LOOPBACK = "tcp:127.0.0.1:0"
TIMEOUT_S = 10.0
MACHINE = BUNDLED_MACHINES / "lee-2001-lathe.toml"


def tell(served: Served, *lines: str) -> list[str]:
    """Type lines on the control socket; return the verdict of each."""
    host, _, port = served.control.removeprefix("tcp:").rpartition(":")
    with closing(socket.create_connection((host, int(port)), timeout=TIMEOUT_S)) as control:
        control.sendall("".join(f"{line}\n" for line in lines).encode())
        control.shutdown(socket.SHUT_WR)
        said = b"".join(iter(lambda: control.recv(4096), b"")).decode()
    return re.findall(r"^(?:ok|refused: .*)$", said, re.MULTILINE)


def console(*words: str) -> subprocess.CompletedProcess[str]:
    return completed(words, TIMEOUT_S)


@pytest.fixture(scope="module")
def module_served(serve: Serve) -> Iterator[Served]:
    with serve("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0", "--pty", "--control", LOOPBACK) as running:
        yield running
        assert running.end()[0] == 0


@pytest.fixture
def served(module_served: Served) -> Iterator[Served]:
    yield module_served
    assert tell(module_served, "clear", "power-cycle") == ["ok", "ok"]


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def tcp_is_open(served: Served) -> bool:
    """Whether a connection is not reset at once."""
    with closing(socket.create_connection(served.tcp, timeout=TIMEOUT_S)) as host:
        try:
            host.sendall(b"I3=2\r")
            return bool(host.recv(1))
        except ConnectionError:
            return False


@contextmanager
def client_over_tcp(served: Served) -> Iterator[PmacClient]:
    host, port = served.tcp
    link = TcpLink(TcpAddress(host=host, port=port))
    try:
        client = PmacClient(link, RealClock())
        client.connect()
        yield client
    finally:
        link.close()


@contextmanager
def client_over_pty(device: str) -> Iterator[PmacClient]:
    link = SerialLink(SerialAddress(device=device))
    try:
        client = PmacClient(link, RealClock())
        client.connect()
        yield client
    finally:
        link.close()


def test_the_control_socket_is_told_like_the_other_addresses(served: Served) -> None:
    assert re.fullmatch(r"tcp:127\.0\.0\.1:[1-9]\d*", served.control)
    verdicts = tell(served, "list", "inject lightning", "inject nul share=2", "active")
    assert [verdict.partition(":")[0] for verdict in verdicts] == ["ok", "refused", "refused", "ok"]
    assert "0 < share <= 1" in verdicts[2]


def test_a_line_without_an_end_is_not_read_for_ever(served: Served) -> None:
    host, _, port = served.control.removeprefix("tcp:").rpartition(":")
    with closing(socket.create_connection((host, int(port)), timeout=TIMEOUT_S)) as control:
        control.sendall(b"x" * 4096)
        control.sendall(b"x")
        with suppress(ConnectionResetError):
            assert control.recv(1) == b""
    assert tell(served, "active") == ["ok"]


def test_the_command_asks_for_a_fault_and_tells_a_refusal(served: Served) -> None:
    address = f"control:{served.control}"
    asked = console("fault", address, "inject", "nul", "after=1000")
    assert (asked.returncode, asked.stderr) == (0, "")
    assert asked.stdout.startswith("nul share=1 seed=0, from ")
    refused = console("fault", address, "inject", "nul", "share=2")
    assert (refused.returncode, refused.stdout, len(refused.stderr.splitlines())) == (1, "", 1)
    assert "0 < share <= 1" in refused.stderr
    assert console("fault", address, "active").stdout.endswith("(waits)\n")


def test_a_tcp_client_meets_pieces_a_nul_and_a_cut(served: Served) -> None:
    with client_over_tcp(served) as client:
        client.request("P1=1234567")
        tell(served, "inject split-segments pieces=4 gap_ms=20")
        assert client.numbers("P1") == (1234567,)
        tell(served, "clear", "inject nul replies=1")
        with pytest.raises(LinkError):
            client.numbers("P1")
        assert client.numbers("P1") == (1234567,)
        tell(served, "inject cut-cable for=0.2")
        with pytest.raises(LinkError) as lost:
            client.numbers("P1")
        assert lost.value.problems[0].code == "link.lost"
    wait_until(lambda: tcp_is_open(served))
    with client_over_tcp(served) as client:
        assert client.numbers("P1") == (1234567,)


def test_segments_leave_one_by_one(served: Served) -> None:
    with closing(socket.create_connection(served.tcp, timeout=TIMEOUT_S)) as host:
        host.sendall(b"I3=2 P1=25 P2=50\r")
        assert host.recv(4096) == b"\x06"
        tell(served, "inject split-segments pieces=2 gap_ms=500")
        host.sendall(b"P1P2\r")
        assert [host.recv(4096), host.recv(4096)] == [b"25\r", b"50\r\x06"]


def test_a_board_is_silent_while_it_hangs_and_answers_afterwards(served: Served) -> None:
    with closing(socket.create_connection(served.ethernet, timeout=TIMEOUT_S)) as host:
        tell(served, "inject hang for=0.3")
        before = time.monotonic()
        host.sendall(bytes.fromhex("40bf00000000000d") + b"i6=1 i3=2 ver")
        assert host.recv(4096).endswith(b"\r\x06")
        assert time.monotonic() - before > 0.25


def test_a_serial_line_has_a_name_that_nobody_else_can_get(served: Served) -> None:
    device = Path(served.device)
    assert stat.S_IMODE(device.parent.stat().st_mode) == 0o700
    assert re.fullmatch(r"/dev/pts/\d+", str(device.readlink()))


def test_a_serial_line_hangs_up_and_comes_back_where_it_was(served: Served) -> None:
    """Also while a host that has not let go keeps the old pseudo-terminal."""
    held = os.open(served.device, os.O_RDWR | os.O_NOCTTY)
    tell(served, "inject cut-cable for=0.1")
    wait_until(lambda: not os.path.exists(served.device))
    wait_until(lambda: os.path.exists(served.device))
    with client_over_pty(served.device) as client:
        assert client.query("#") == ("1",)
    os.close(held)
    with client_over_pty(served.device) as client:
        client.request("P3=7")
        tell(served, "inject cut-cable for=0.2")
        with pytest.raises(LinkError) as lost:
            while True:
                client.numbers("P3")
        assert lost.value.problems[0].code == "link.lost"
    wait_until(lambda: os.path.exists(served.device))
    with client_over_pty(served.device) as client:
        assert client.numbers("P3") == (7,)


def test_a_dead_card_is_silent_on_all_lines_until_it_is_switched_off_and_on(served: Served) -> None:
    with client_over_tcp(served) as client, client_over_pty(served.device) as other:
        tell(served, "inject watchdog")
        for each in (client, other):
            with pytest.raises(LinkTimeoutError):
                each.request("P1", timeout_s=0.2)
        tell(served, "power-cycle")
        for each in (client, other):
            each.connect()


def test_a_socket_in_the_file_system_is_the_owners_and_gone_in_the_end(serve: Serve, tmp_path: Path) -> None:
    path = tmp_path / "faults"
    with serve("--tcp", "127.0.0.1:0", "--control", f"unix:{path}") as running:
        assert running.control == f"unix:{path}"
        mode = path.stat().st_mode
        assert (stat.S_ISSOCK(mode), stat.S_IMODE(mode)) == (True, 0o600)
        assert console("fault", f"unix:{path}", "active").returncode == 0
        second = console("simulator", "--tcp", "127.0.0.1:0", "--control", f"unix:{path}")
        assert (second.returncode, len(second.stderr.splitlines())) == (1, 1)
        assert running.end(signal.SIGTERM)[0] == 0
    assert not path.exists()


def test_a_socket_that_a_dead_simulator_left_is_taken_over_and_a_file_is_not(serve: Serve, tmp_path: Path) -> None:
    path = tmp_path / "faults"
    with serve("--tcp", "127.0.0.1:0", "--control", f"unix:{path}") as running:
        running.process.kill()
        running.process.wait(TIMEOUT_S)
    assert path.is_socket()
    with serve("--tcp", "127.0.0.1:0", "--control", f"unix:{path}") as running:
        assert console("fault", f"unix:{path}", "active").returncode == 0
        assert running.end()[0] == 0
    path.write_text("mine")
    refused = console("simulator", "--tcp", "127.0.0.1:0", "--control", f"unix:{path}")
    assert (refused.returncode, len(refused.stderr.splitlines())) == (1, 1)
    assert path.read_text() == "mine"


def test_the_simulator_of_the_console_has_faults_over_its_channel_and_its_line_comes_back_where_it_was() -> None:
    simulator = SimulatorProcess.start(MACHINE, seed=1)
    device = simulator.address.device
    try:
        with client_over_pty(device) as client:
            assert simulator.fault("inject nul replies=1").endswith("\nok\n")
            with pytest.raises(LinkError):
                client.numbers("P1")
            assert client.numbers("P1") == (0,)
            assert simulator.fault("active") == "ok\n"
            for line, told in (
                ("inject lightning", "split-segments"),
                ("inject stranger-writes line=" + "P" * 100_000, "4096 bytes"),
            ):
                with pytest.raises(LinkError) as refused:
                    simulator.fault(line)
                assert refused.value.problems[0].code == "simulator.refused"
                assert told in refused.value.problems[0].value
            assert simulator.fault("active") == "ok\n"
            simulator.fault("inject cut-cable for=0.2")
            with pytest.raises(LinkError) as lost:
                while True:
                    client.numbers("P3")
            assert lost.value.problems[0].code == "link.lost"
            wait_until(lambda: os.path.exists(device))
            with client_over_pty(device) as again:
                assert again.numbers("P3") == (0,)
    finally:
        simulator.close()
    assert not Path(device).parent.exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_simulator_that_has_died_leaves_no_name(number: int) -> None:
    """A name that led to nothing could lead to the line of somebody else tomorrow."""
    simulator = SimulatorProcess.start(MACHINE, seed=1)
    os.kill(simulator._child._process.pid, number)
    simulator.close()
    assert not Path(simulator.address.device).parent.exists()


# `console simulator` as other programs meet it: a real process, a real port, plain sockets.


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


def wait_until_simulator(condition: Callable[[], bool], seconds: float = 10.0) -> None:
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
    wait_until_simulator(lambda: host.number("#2P") > 5000)
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
    wait_until_simulator(lambda: not int(host.ask("&1??")[5:6], 16) & 1)
    wait_until_simulator(lambda: host.number("#1P") < -9000)


def test_two_hosts_have_their_own_addressing_and_one_that_raves_harms_nobody(
    host: Host, address: tuple[str, int]
) -> None:
    assert host.ask("#2") == b"\x06"
    with socket.create_connection(address, timeout=10) as other:
        other.sendall(b"#1\r" + bytes(range(256)) * 50 + b"\rOPEN PROG 9\rX10")
    assert host.ask("#") == b"2\r\x06"
    assert host.ask("P5=7 P5") == b"7\r\x06"
    wait_until_simulator(lambda: host.ask("OPEN PROG 8") == b"\x06")
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
