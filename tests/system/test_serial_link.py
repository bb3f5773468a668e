"""The serial link on real pseudo-terminals whose far end is the test."""

from __future__ import annotations

import fcntl
import os
import signal
import termios
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import pytest
import serial

from drivers.clock import RealClock
from drivers.errors import ControllerError, LinkError
from drivers.lathe.stop import StopPath
from drivers.link.address import SerialAddress
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


def test_receiving_waits_no_longer_than_it_was_told(link: SerialLink) -> None:
    began = time.monotonic()
    assert link.receive(0.1) == b""
    assert link.receive(-1.0) == b""
    assert 0.1 <= time.monotonic() - began < 1.0


def test_the_client_speaks_over_it(link: SerialLink, far_end: FarEnd) -> None:
    def controller() -> None:
        far_end.read(6)
        os.write(far_end.line, b"25\r5")
        os.write(far_end.line, b"0\r\x06")
        far_end.read(3)
        os.write(far_end.line, b"\x07ERR003\r")

    answering = threading.Thread(target=controller)
    answering.start()
    client = PmacClient(link, RealClock())
    assert client.request("P1..2") == ("25", "50")
    with pytest.raises(ControllerError) as refused:
        client.request("UU")
    answering.join(5)
    assert refused.value.error_number == 3


def test_a_line_that_is_unplugged_is_a_lost_link(link: SerialLink, far_end: FarEnd) -> None:
    far_end.unplug()
    for use in (lambda: link.receive(1.0), lambda: link.send(b"P1\r"), lambda: link.send_urgent(b"\x0b")):
        with pytest.raises(LinkError) as error:
            use()
        assert lost(error)
    stop = StopPath(link)
    stop.stop("unplugged")
    assert stop.reason == "unplugged"


def test_unplugging_ends_a_wait_at_once(link: SerialLink, far_end: FarEnd) -> None:
    threading.Timer(0.2, far_end.unplug).start()
    began = time.monotonic()
    with pytest.raises(LinkError) as error:
        link.receive(20.0)
    assert lost(error)
    assert time.monotonic() - began < 5.0


def test_a_closed_link_says_that_it_is_lost_and_does_not_raise_anything_else(link: SerialLink) -> None:
    link.close()
    for use in (lambda: link.receive(0.1), lambda: link.send(b"P1\r"), lambda: link.send_urgent(b"\x0b")):
        with pytest.raises(LinkError) as error:
            use()
        assert lost(error)
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
