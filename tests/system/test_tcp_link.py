"""The TCP link against a plain socket server."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from drivers.clock import RealClock
from drivers.errors import ControllerError, LinkError, LinkTimeoutError
from drivers.lathe.stop import StopPath
from drivers.link.address import TcpAddress
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient

pytestmark = pytest.mark.system

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


def test_a_closed_link_says_that_it_is_lost_and_does_not_raise_anything_else() -> None:
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


def test_receiving_waits_no_longer_than_it_was_told() -> None:
    held = threading.Event()
    with linked(holding(held)) as link:
        began = time.monotonic()
        assert link.receive(0.1) == b""
        assert link.receive(-1.0) == b""
        assert 0.1 <= time.monotonic() - began < 1.0
        held.set()


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


def test_a_stop_does_not_wait_for_a_send_that_is_stuck() -> None:
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
