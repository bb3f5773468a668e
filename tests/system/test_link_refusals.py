"""Each way in which a link cannot be opened, or ends, is an error of its own: real files, lines and sockets."""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import re
import socket
import subprocess
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from console.text.catalogue import load
from drivers.errors import LinkError
from drivers.link import connection, ethernet, serial
from drivers.link.address import (
    EthernetAddress,
    SerialAddress,
    SimulatedAddress,
    TcpAddress,
    WiredAddress,
    parse_address,
)
from drivers.link.opening import open_link
from profiles.problem import Problem

pytestmark = pytest.mark.system

NOBODY = 65_534
LOCK_IT = (
    "import fcntl, os, sys; line = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY);"
    " fcntl.flock(line, fcntl.LOCK_EX); print('locked', flush=True); sys.stdin.read()"
)


def refusal(address: WiredAddress) -> Problem:
    with pytest.raises(LinkError) as refused:
        open_link(address)
    (problem,) = refused.value.problems
    assert problem.where == str(address)
    for language in ("en", "ko"):
        # The sentence has room for every fact, and says what helps behind the first semicolon.
        assert re.search(r"; .", load(language).problem(problem))
    return problem


@pytest.fixture
def device() -> Iterator[str]:
    line, far_end = os.openpty()
    tty.setraw(far_end)
    yield os.ttyname(far_end)
    os.close(line)
    os.close(far_end)


Network = type[TcpAddress] | type[EthernetAddress]


@pytest.fixture(params=["tcp", "ethernet"])
def network(request: pytest.FixtureRequest) -> Network:
    return TcpAddress if request.param == "tcp" else EthernetAddress


@contextmanager
def as_nobody() -> Iterator[None]:
    """Be a user whom rights concern; not everybody may become one."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(0)


@pytest.mark.parametrize(
    ("name", "code", "reason"),
    [
        ("missing", "link.no_device", "No such file or directory"),
        ("file/ttyS0", "link.no_device", "Not a directory"),
        ("file", "link.not_serial", "Inappropriate ioctl for device"),
        ("folder", "link.not_serial", "Is a directory"),
        ("fifo", "link.not_serial", "Inappropriate ioctl for device"),
    ],
)
def test_what_is_no_serial_line_is_told_from_what_is_not_there(
    tmp_path: Path, name: str, code: str, reason: str
) -> None:
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "fifo")
    problem = refusal(SerialAddress(device=str(tmp_path / name)))
    assert (problem.code, problem.value) == (code, reason)


def test_a_device_that_is_none_of_a_line_is_told(device: str) -> None:
    assert refusal(SerialAddress(device="/dev/null")).code == "link.not_serial"


def test_a_line_that_another_program_has_is_busy_and_it_is_said_which(device: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", LOCK_IT, device], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None and other.stdin is not None
        assert other.stdout.readline() == b"locked\n"
        problem = refusal(SerialAddress(device=device))
        other.stdin.close()
    assert problem.code == "link.busy"
    assert re.fullmatch(rf"\S+, PID {other.pid}", problem.value)
    open_link(SerialAddress(device=device)).close()


def test_a_second_console_on_the_same_line_is_refused_and_harms_the_first_one_not(device: str) -> None:
    first = open_link(SerialAddress(device=device))
    settings = os.open(device, os.O_RDWR | os.O_NOCTTY)
    before = termios.tcgetattr(settings)
    assert refusal(SerialAddress(device=device, baud_rate=9600)).code == "link.busy"
    assert termios.tcgetattr(settings) == before
    os.close(settings)
    first.close()
    open_link(SerialAddress(device=device)).close()


def test_a_pseudo_terminal_is_not_closed_to_everybody_for_ever(device: str) -> None:
    """That flag would outlive a program that is killed, as long as the far end is open."""
    exclusive = bytearray(4)
    link = open_link(SerialAddress(device=device))
    other = os.open(device, os.O_RDWR | os.O_NOCTTY)
    fcntl.ioctl(other, 0x8004_5440, exclusive)  # TIOCGEXCL
    os.close(other)
    link.close()
    assert bytes(exclusive) == bytes(4)


def test_a_line_of_a_group_is_told_with_that_group(device: str) -> None:
    group = next((entry for entry in grp.getgrall() if entry.gr_gid not in (0, NOBODY, *os.getgroups())), None)
    if os.geteuid() != 0 or group is None:
        pytest.skip("only root may give a device away")
    os.chown(device, 0, group.gr_gid)
    os.chmod(device, 0o660)
    with as_nobody():
        problem = refusal(SerialAddress(device=device))
    assert (problem.code, problem.limit, problem.value) == ("link.no_permission", group.gr_name, "crw-rw----")
    assert f"usermod -aG {group.gr_name} " in load("en").problem(problem)


def test_a_line_of_one_user_is_told_with_that_user(device: str) -> None:
    os.chmod(device, 0o000)
    with as_nobody():
        problem = refusal(SerialAddress(device=device))
    assert problem.code == "link.owner_only"
    assert problem.value == "c---------"


def test_an_unusual_speed_is_had_and_read_back(device: str) -> None:
    """76 800 is one of the speeds that a PMAC can be set to, and none of those that systems have names for."""
    link = open_link(SerialAddress(device=device, baud_rate=76_800))
    line = os.open(device, os.O_RDWR | os.O_NOCTTY)
    assert serial.speed_of(line) == 76_800
    os.close(line)
    link.close()


@pytest.mark.parametrize(("speed", "taken"), [(9600, False), (37_600, False), (37_800, True), (39_100, True)])
def test_a_line_that_stays_at_another_speed_is_refused(
    device: str, monkeypatch: pytest.MonkeyPatch, speed: int, taken: bool
) -> None:
    """A driver keeps what it can do without a word; two in a hundred are what characters survive."""
    monkeypatch.setattr(serial, "speed_of", lambda line: speed)
    address = SerialAddress(device=device)
    if taken:
        open_link(address).close()
        return
    problem = refusal(address)
    assert (problem.code, problem.value, problem.limit) == ("link.baud", "38400", str(speed))
    monkeypatch.undo()
    open_link(address).close()  # it was let go of


def test_a_name_that_does_not_exist_is_told(network: Network) -> None:
    problem = refusal(network(host="no-such-host.invalid", port=1025))
    assert (problem.code, problem.value) == ("link.unknown_host", "no-such-host.invalid")


def test_a_name_that_no_host_can_have_is_told(network: Network) -> None:
    assert refusal(network(host="a" * 70, port=1025)).code == "link.unknown_host"


def test_a_port_where_nobody_listens_is_refused(network: Network) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = int(listener.getsockname()[1])
    problem = refusal(network(host="127.0.0.1", port=port))
    assert (problem.code, problem.value) == ("link.refused", "Connection refused")


def test_a_port_that_takes_no_more_connections_does_not_answer(
    network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "CONNECT_TIMEOUT_S", 0.3)
    with socket.create_server(("127.0.0.1", 0), backlog=0) as listener:
        port = int(listener.getsockname()[1])
        waiting = [socket.socket() for _ in range(4)]
        for other in waiting:
            other.setblocking(False)
            other.connect_ex(("127.0.0.1", port))
        problem = refusal(network(host="127.0.0.1", port=port))
        for other in waiting:
            other.close()
    assert (problem.code, problem.value) == ("link.no_answer", "0.3 s")


@pytest.mark.parametrize("number", [errno.EHOSTUNREACH, errno.ENETUNREACH])
def test_an_address_without_a_way_to_it_is_told(
    network: Network, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """What the network of this computer would say; which addresses have no way is different everywhere."""

    def create_connection(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(socket, "create_connection", create_connection)
    problem = refusal(network(host="192.6.94.5", port=1025))
    assert (problem.code, problem.value) == ("link.unreachable", os.strerror(number))


def test_a_port_that_is_silent_is_a_link_on_which_nothing_comes(network: Network) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        link = open_link(network(host="127.0.0.1", port=int(listener.getsockname()[1])))
        link.send(b"P1\r")
        assert link.receive(0.05) == b""
        link.close()


@pytest.mark.parametrize(("linger", "code"), [(False, "link.closed"), (True, "link.lost")])
def test_a_controller_that_closes_is_told_from_a_connection_that_broke(
    network: Network, linger: bool, code: str
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        link = open_link(network(host="127.0.0.1", port=int(listener.getsockname()[1])))
        host, _ = listener.accept()
        if linger:
            host.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        host.close()
        with pytest.raises(LinkError) as ended:
            link.receive(5.0)
        link.close()
    assert ended.value.problems[0].code == code


def test_a_board_with_room_for_one_connection_says_that_stops_have_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "CONNECT_TIMEOUT_S", 0.3)
    with socket.create_server(("127.0.0.1", 0), backlog=0) as listener:
        port = int(listener.getsockname()[1])
        problem = refusal(EthernetAddress(host="127.0.0.1", port=port, reserves_stop=True))
    assert (problem.code, problem.value) == ("link.no_stop_connection", "0.3 s")


def test_a_connection_for_stops_that_the_network_takes_and_no_board_serves_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ethernet, "OPENING_S", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = int(listener.getsockname()[1])
        problem = refusal(EthernetAddress(host="127.0.0.1", port=port, reserves_stop=True))
    assert (problem.code, problem.value) == ("link.no_stop_connection", "0.05 s")


def test_the_simulated_lathe_is_an_address_without_a_wire() -> None:
    assert parse_address("sim:") == SimulatedAddress()
