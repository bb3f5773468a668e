"""The serial link on real pseudo-terminals whose far end is the test."""

from __future__ import annotations

import fcntl
import os
import signal
import socket
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import pytest
import serial

from drivers.clock import RealClock
from drivers.errors import ControllerError, LinkError, LinkTimeoutError
from drivers.lathe.stop import StopPath
from drivers.link.address import SerialAddress, TcpAddress
from drivers.link.opening import TcpLink
from drivers.link.serial import SerialLink
from drivers.pmac.client import PmacClient

pytestmark = pytest.mark.system


@dataclass
class FarEnd:
    """The controller's end of a line, in the hands of a test."""

    line: int
    device: str

    def read(self, count: int) -> bytes:
        """Return exactly so many bytes; the time limit of the test bounds the wait."""
        data = b""
        while len(data) < count:
            data += os.read(self.line, count - len(data))
        return data

    def unplug(self) -> None:
        if self.line >= 0:
            os.close(self.line)
            self.line = -1


@pytest.fixture
def far_end() -> Iterator[FarEnd]:
    line, slave = os.openpty()
    tty.setraw(slave)
    end = FarEnd(line, os.ttyname(slave))
    yield end
    os.close(slave)
    end.unplug()


@pytest.fixture
def link(far_end: FarEnd) -> Iterator[SerialLink]:
    opened = SerialLink(SerialAddress(device=far_end.device))
    yield opened
    opened.close()


def lost(error: pytest.ExceptionInfo[LinkError]) -> bool:
    return error.value.problems[0].code == "link.lost"


def fill(link: SerialLink) -> None:
    """Put as much on the line as it takes while nobody reads."""
    line = link._line.fileno()
    # What a line holds moves on a little by itself: only one that stays full is full.
    quiet_since = time.monotonic()
    while time.monotonic() < quiet_since + 0.1:
        with suppress(BlockingIOError):
            os.write(line, b"P1\r" * 100)
            quiet_since = time.monotonic()


def test_bytes_pass_as_they_are_both_ways(link: SerialLink, far_end: FarEnd) -> None:
    every = bytes(range(256))
    link.send(every)
    assert far_end.read(256) == every
    os.write(far_end.line, every)
    data = b""
    while len(data) < 256:
        data += link.receive(1.0)
    assert data == every


def test_the_line_is_set_up_as_the_address_says(far_end: FarEnd) -> None:
    link = SerialLink(SerialAddress(device=far_end.device, baud_rate=9600))
    iflag, _, cflag, lflag, ispeed, ospeed, _ = termios.tcgetattr(link._line.fileno())
    link.close()
    assert (ispeed, ospeed) == (termios.B9600, termios.B9600)
    assert cflag & termios.CSIZE == termios.CS8
    assert not cflag & (termios.PARENB | termios.CSTOPB | termios.CRTSCTS)
    assert not iflag & (termios.IXON | termios.IXOFF | termios.ICRNL)
    assert not lflag & (termios.ICANON | termios.ECHO | termios.ISIG)
    assert link.address == f"serial:{far_end.device}?baud=9600"


def uses(link: SerialLink) -> list[Callable[[], object]]:
    return [lambda: link.receive(1.0), lambda: link.send(b"P1\r"), lambda: link.send_urgent(b"\x0b")]


def test_a_line_that_is_unplugged_or_closed_is_a_lost_link_and_ends_a_wait_at_once(
    link: SerialLink, far_end: FarEnd
) -> None:
    threading.Timer(0.2, far_end.unplug).start()
    began = time.monotonic()
    with pytest.raises(LinkError) as error:
        link.receive(20.0)
    assert lost(error) and time.monotonic() - began < 5.0
    stop = StopPath(link)
    stop.stop("unplugged")
    assert stop.reason == "unplugged"
    for closed in (False, True):
        for use in uses(link):
            with pytest.raises(LinkError) as error:
                use()
            assert lost(error), closed
        link.close()


def test_a_stop_goes_while_a_reply_is_pending(link: SerialLink, far_end: FarEnd) -> None:
    link.send(b"P1\r")
    link.send_urgent(b"\x0b")
    assert far_end.read(4) == b"P1\r\x0b"


def test_a_stop_never_waits_for_a_peer_that_does_not_read(link: SerialLink, far_end: FarEnd) -> None:
    fill(link)
    began = time.monotonic()
    with pytest.raises(LinkError) as error:
        link.send_urgent(b"\x0b")
    assert time.monotonic() - began < 0.5
    assert lost(error)
    os.read(far_end.line, 65_536)
    link.send_urgent(b"\x0b")


def test_a_stop_does_not_wait_for_a_send_that_is_stuck(link: SerialLink, far_end: FarEnd) -> None:
    """Another thread is in the middle of a line that nobody takes; then the peer reads a little again."""
    fill(link)
    failures: list[LinkError] = []
    begun = threading.Event()

    def send_much() -> None:
        begun.set()
        try:
            link.send(b"I130=528\r" * 10_000)
        except LinkError as error:
            failures.append(error)

    sender = threading.Thread(target=send_much)
    sender.start()
    assert begun.wait(5.0)
    began = time.monotonic()
    StopPath(link).stop("operator")
    assert time.monotonic() - began < 0.5
    assert sender.is_alive()
    sender.join(20)
    assert failures[0].problems[0].code == "link.lost"


def test_a_stop_from_a_signal_goes_past_the_send_that_it_interrupts(link: SerialLink, far_end: FarEnd) -> None:
    took_s: list[float] = []
    stop = StopPath(link)

    def handle(number: int, frame: object) -> None:
        began = time.monotonic()
        stop.stop("signal")
        took_s.append(time.monotonic() - began)

    previous = signal.signal(signal.SIGUSR1, handle)
    fill(link)
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGUSR1)).start()
    try:
        with pytest.raises(LinkError):
            link.send(b"P1\r")
    finally:
        signal.signal(signal.SIGUSR1, previous)
    assert took_s[0] < 0.5


def test_a_stop_lands_between_the_lines_that_another_thread_sends(link: SerialLink, far_end: FarEnd) -> None:
    lines, received = 500, bytearray()

    def read_all() -> None:
        while received.count(b"\r") < lines or received.count(b"\x0b") < 3:
            received.extend(os.read(far_end.line, 4096))

    def send_much() -> None:
        for _ in range(lines):
            link.send(b"I130=528\r")

    threads = [threading.Thread(target=read_all), threading.Thread(target=send_much)]
    for thread in threads:
        thread.start()
    for _ in range(3):
        link.send_urgent(b"\x0b")
    for thread in threads:
        thread.join(20)
    assert set(bytes(received).replace(b"\x0b", b"").split(b"\r")) <= {b"I130=528", b""}


def test_at_9600_baud_no_more_is_ahead_of_a_stop_than_goes_in_20_ms(far_end: FarEnd) -> None:
    """960 characters a second. Nobody reads meanwhile, and the pseudo-terminal takes all that it is given.

    What was handed over by the time of the stop is what could have left by then, and what is ahead of it.
    """
    link = SerialLink(SerialAddress(device=far_end.device, baud_rate=9600))
    text = b"P1..200=42 " * 20
    began = time.monotonic()
    sender = threading.Thread(target=link.send, args=(text,))
    sender.start()
    threading.Event().wait(0.06)
    link.send_urgent(b"\x0b")
    elapsed_s = time.monotonic() - began
    sender.join(20)
    data = far_end.read(len(text) + 1)
    assert data.replace(b"\x0b", b"") == text
    handed_over = data.index(b"\x0b") + 1
    assert handed_over <= (elapsed_s + 0.020) * 960.0
    assert handed_over < len(text)
    link.close()


def test_another_program_may_not_open_the_device_either(link: SerialLink, far_end: FarEnd) -> None:
    with pytest.raises(serial.SerialException):
        serial.Serial(far_end.device, exclusive=True)
    other = os.open(far_end.device, os.O_RDWR | os.O_NOCTTY)
    with pytest.raises(BlockingIOError):
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    os.close(other)


# The TCP link against a plain socket server.


Handler = Callable[[socket.socket], None]


@contextmanager
def serving(handle: Handler) -> Iterator[TcpAddress]:
    """Accept one host and let `handle` speak with it."""
    listener = socket.create_server(("127.0.0.1", 0))
    failures: list[BaseException] = []

    def accept() -> None:
        try:
            connection, _ = listener.accept()
            with connection:
                connection.settimeout(5.0)
                handle(connection)
        except OSError:
            pass  # the host went first
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    try:
        yield TcpAddress(host="127.0.0.1", port=listener.getsockname()[1])
    finally:
        listener.close()
        thread.join(5.0)
        assert not thread.is_alive()
        assert not failures


@contextmanager
def linked(handle: Handler) -> Iterator[TcpLink]:
    with serving(handle) as address:
        link = TcpLink(address)
        try:
            yield link
        finally:
            link.close()


def read_until(connection: socket.socket, end: bytes) -> bytes:
    data = b""
    while not data.endswith(end):
        data += connection.recv(1)
    return data


def holding(release: threading.Event) -> Handler:
    """Say nothing until released."""

    def hold(connection: socket.socket) -> None:
        release.wait(5.0)

    return hold


def test_a_controller_that_closes_inside_a_reply_is_a_closed_link_and_no_reply() -> None:
    def half(connection: socket.socket) -> None:
        read_until(connection, b"\r")
        connection.sendall(b"25\r5")

    with linked(half) as link, pytest.raises(LinkError) as lost:
        PmacClient(link, RealClock()).request("P1..2")
    assert lost.value.problems[0].code == "link.closed"


def test_a_closed_tcp_link_says_that_it_is_lost_and_does_not_raise_anything_else() -> None:
    with linked(lambda connection: None) as link:
        link.close()
        for use in (lambda: link.send(b"P1\r"), lambda: link.receive(0.1), lambda: link.send_urgent(b"\x0b")):
            with pytest.raises(LinkError) as lost:
                use()
            assert lost.value.problems[0].code == "link.lost"
        link.close()


def test_a_stop_over_a_lost_link_is_remembered_and_does_not_raise() -> None:
    with linked(lambda connection: None) as link:
        link.close()
        stop = StopPath(link)
        stop.stop("cable cut")
    assert stop.reason == "cable cut"


def test_a_reply_may_come_in_any_segments() -> None:
    def drip(connection: socket.socket) -> None:
        read_until(connection, b"\r")
        for byte in b"25\r50\r75\r\x06":
            connection.sendall(bytes([byte]))
            time.sleep(0.002)
        read_until(connection, b"\r")
        connection.sendall(b"1\r\x07ERR003\r")

    with linked(drip) as link:
        client = PmacClient(link, RealClock())
        assert client.request("P1..3") == ("25", "50", "75")
        with pytest.raises(ControllerError) as refused:
            client.request("P1UUU")
        assert refused.value.error_number == 3


def test_a_silent_controller_times_out_and_is_flushed_and_the_late_reply_is_not_taken_for_the_next() -> None:
    received: list[bytes] = []

    def late(connection: socket.socket) -> None:
        received.append(read_until(connection, b"\r"))
        received.append(read_until(connection, b"\x18"))
        connection.sendall(b"11\r\x06")
        received.append(read_until(connection, b"\r"))
        connection.sendall(b"22\r\x06")

    with linked(late) as link:
        client = PmacClient(link, RealClock())
        began = time.monotonic()
        with pytest.raises(LinkTimeoutError) as silent:
            client.request("P1", timeout_s=0.15)
        assert 0.15 <= time.monotonic() - began < 1.5
        assert silent.value.problems[0].code == "link.silent"
        assert client.request("P2") == ("22",)
    assert received == [b"P1\r", b"\x18", b"P2\r"]


def test_a_stop_is_sent_while_a_reply_is_pending_and_while_another_thread_sends() -> None:
    received = bytearray()
    done = threading.Event()

    def swallow(connection: socket.socket) -> None:
        while data := connection.recv(65_536):
            received.extend(data)
            if received.count(b"\x0b") == 3:
                done.set()

    with linked(swallow) as link:
        stop = StopPath(link)

        def send_much() -> None:
            for _ in range(2000):
                link.send(b"I130=528\r")

        link.send(b"P1\r")
        stop.stop("pending")
        sender = threading.Thread(target=send_much)
        sender.start()
        stop.repeat()
        stop.repeat()
        sender.join()
        assert done.wait(5.0)
    lines = bytes(received).replace(b"\x0b", b"").split(b"\r")
    assert set(lines[:-1]) <= {b"P1", b"I130=528"}
    assert bytes(received).startswith(b"P1\r\x0b")


def test_a_stop_over_tcp_does_not_wait_for_a_send_that_is_stuck() -> None:
    """Another thread is in the middle of lines that nobody takes; the stop is refused within a moment."""
    held = threading.Event()
    failures: list[LinkError] = []

    def send_much(link: TcpLink) -> None:
        try:
            link.send(b"I130=528\r" * 5_000_000)
        except LinkError as error:
            failures.append(error)

    with linked(holding(held)) as link:
        sender = threading.Thread(target=send_much, args=(link,))
        sender.start()
        stop, deadline = StopPath(link), time.monotonic() + 5.0
        while stop.delivered and time.monotonic() < deadline:
            began = time.monotonic()
            stop.stop("operator")
            assert time.monotonic() - began < 0.5
        assert not stop.delivered
        held.set()
        sender.join(10.0)
    assert failures[0].problems[0].code == "link.lost"
