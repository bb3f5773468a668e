"""The link to an Ethernet board against one whose every byte is the test's."""

from __future__ import annotations

import signal
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from drivers.errors import LinkError, LinkTimeoutError
from drivers.lathe.stop import StopPath
from drivers.link import ethernet
from drivers.link.address import EthernetAddress
from drivers.link.base import StopWay
from drivers.link.ethernet import EthernetLink

pytestmark = pytest.mark.system

ABORT = bytes.fromhex("40BF00000000000101")
KILL = bytes.fromhex("40BF0000000000010B")
FLUSH = bytes.fromhex("40B3000000000000")
READY = bytes.fromhex("C0C2000000000002")
"""READREADY, the one request that is no stop on a connection for stops."""

MORE = bytes.fromhex("C0C5000000000578")
"""GETBUFFER, 1400 bytes at most."""


def response(line: bytes) -> bytes:
    return bytes.fromhex("40BF00000000") + len(line).to_bytes(2, "big") + line


class Board:
    """The far end: what has come is read, what is to be said is written."""

    def __init__(self, connection: socket.socket) -> None:
        connection.settimeout(5.0)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.connection = connection

    def expect(self, data: bytes) -> None:
        heard = b""
        while len(heard) < len(data):
            heard += self.connection.recv(len(data) - len(heard))
        assert heard == data

    def say(self, data: bytes) -> None:
        self.connection.sendall(data)

    def heard_nothing_more(self) -> bool:
        self.connection.settimeout(0.05)
        try:
            return not self.connection.recv(1)
        except TimeoutError:
            return True
        finally:
            self.connection.settimeout(5.0)


@contextmanager
def connected(*, reserves_stop: bool = False) -> Iterator[tuple[EthernetLink, list[Board]]]:
    with socket.create_server(("127.0.0.1", 0)) as listener, ThreadPoolExecutor(1) as other:
        port = listener.getsockname()[1]
        opening = other.submit(
            EthernetLink, EthernetAddress(host="127.0.0.1", port=port, reserves_stop=reserves_stop)
        )
        boards = [Board(listener.accept()[0])]
        if reserves_stop:
            boards.append(Board(listener.accept()[0]))
            boards[1].expect(READY)
            boards[1].say(b"\0\0")
        link = opening.result(5.0)
        try:
            yield link, boards
        finally:
            link.close()
            for board in boards:
                board.connection.close()


@pytest.fixture
def both() -> Iterator[tuple[EthernetLink, Board]]:
    with connected() as (link, boards):
        yield link, boards[0]


def way_of(link: EthernetLink) -> StopWay:
    return link.stop_way


def heard(link: EthernetLink, count: int) -> bytes:
    data = b""
    while len(data) < count:
        data += link.receive(5.0)
    return data


def test_a_line_is_one_request_without_its_cr_and_line_feeds_are_dropped(both: tuple[EthernetLink, Board]) -> None:
    link, board = both
    link.send(b"#1J")
    assert board.heard_nothing_more()
    link.send(b"/\r\n")
    board.expect(response(b"#1J/"))
    board.say(b"\x06")
    assert link.receive(5.0) == b"\x06"


def test_a_second_line_waits_for_the_answer_to_the_first(both: tuple[EthernetLink, Board]) -> None:
    link, board = both
    sender = threading.Thread(target=link.send, args=(b"P1\rP2\r",))
    sender.start()
    board.expect(response(b"P1"))
    assert board.heard_nothing_more()
    board.say(b"1\r\x06")
    board.expect(response(b"P2"))
    sender.join(5.0)
    board.say(b"2\r\x06")
    assert heard(link, 6) == b"1\r\x062\r\x06"


def test_a_line_behind_one_that_is_never_answered_is_not_sent(
    both: tuple[EthernetLink, Board], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ethernet, "REPLY_WAIT_S", 0.1)
    link, board = both
    link.send(b"P1=1\r")
    with pytest.raises(LinkTimeoutError) as silent:
        link.send(b"P2=2\r")
    (problem,) = silent.value.problems
    assert (problem.code, problem.key, problem.value) == ("link.silent", "P1=1", "0.1 s")
    board.expect(response(b"P1=1"))
    assert board.heard_nothing_more()


def test_a_line_waits_no_longer_for_an_answer_than_its_reader_did(
    both: tuple[EthernetLink, Board], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In motion a stop is due once two polls were not answered; 2 s more were spent here."""
    monkeypatch.setattr(ethernet, "LEAST_WAIT_S", 0.15)
    link, _ = both
    link.send(b"P1\r")
    assert link.receive(0.12) == b""
    with pytest.raises(LinkTimeoutError) as silent:
        link.send(b"P2\r")
    assert silent.value.problems[0].value == "0.15 s"


@pytest.mark.parametrize("said", [b"@", b"\x18"])
def test_control_x_is_a_flush_and_what_was_asked_before_is_forgotten(
    both: tuple[EthernetLink, Board], said: bytes
) -> None:
    link, board = both
    link.send(b"P1\rP")
    link.send(b"\x18")
    board.expect(response(b"P1") + FLUSH)
    board.say(b"1\r\x06" + said)
    link.send(b"P2\r")
    board.expect(response(b"P2"))
    board.say(b"2\r\x06")
    assert link.receive(5.0) == b"2\r\x06"


def test_an_answer_of_1400_bytes_is_asked_for_its_rest_and_an_end_at_the_last_byte_is_an_end(
    both: tuple[EthernetLink, Board],
) -> None:
    link, board = both
    link.send(b"P0..1000\r")
    board.expect(response(b"P0..1000"))
    board.say(b"1" * 1399 + b"\r")
    assert heard(link, 1400) == b"1" * 1399 + b"\r"
    board.expect(MORE)
    board.say(b"2" * 1398 + b"\r\x06")
    assert heard(link, 1400) == b"2" * 1398 + b"\r\x06"
    assert board.heard_nothing_more()


def test_a_nul_is_passed_on(both: tuple[EthernetLink, Board]) -> None:
    link, board = both
    link.send(b"SAVE\r")
    board.expect(response(b"SAVE"))
    board.say(b"\0")
    assert link.receive(5.0) == b"\0"


def test_a_stop_is_one_request_behind_that_in_flight_and_its_answer_is_no_answer(
    both: tuple[EthernetLink, Board],
) -> None:
    link, board = both
    link.send(b"P1\r")
    link.send_urgent(b"\x01")
    link.send_urgent(b"\x0b")
    board.expect(response(b"P1") + ABORT + KILL)
    board.say(b"1\r\x06\x06\x06")
    assert link.receive(5.0) == b"1\r\x06"
    link.send(b"P2\r")
    board.expect(response(b"P2"))
    board.say(b"2\r\x06")
    assert link.receive(5.0) == b"2\r\x06"


def test_the_answer_to_a_stop_may_come_at_any_time_and_is_waited_for(both: tuple[EthernetLink, Board]) -> None:
    link, board = both
    link.send_urgent(b"\x01")
    board.expect(ABORT)
    sender = threading.Thread(target=link.send, args=(b"P1\r",))
    sender.start()
    assert board.heard_nothing_more()
    board.say(b"\x06")
    board.expect(response(b"P1"))
    sender.join(5.0)
    board.say(b"1\r\x06")
    assert link.receive(5.0) == b"1\r\x06"


def test_stops_have_the_second_connection_for_themselves() -> None:
    with connected(reserves_stop=True) as (link, (lines, stops)):
        assert way_of(link) is StopWay.RESERVED
        link.send(b"P1\r")
        lines.expect(response(b"P1"))
        link.send_urgent(b"\x01")
        stops.expect(ABORT)
        stops.say(b"\x06")
        assert link.receive(0.05) == b""
        link.send_urgent(b"\x0b")
        stops.expect(KILL)
        lines.say(b"1\r\x06")
        assert link.receive(5.0) == b"1\r\x06"
        assert lines.heard_nothing_more()


def test_a_stop_that_nobody_answers_on_its_own_connection_is_repeated_on_both(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with connected(reserves_stop=True) as (link, (lines, stops)):
        link.send_urgent(b"\x01")
        stops.expect(ABORT)
        link.send_urgent(b"\x01")
        stops.expect(ABORT)
        lines.expect(ABORT)
        assert way_of(link) is StopWay.RESERVED, "a board takes its time"
        monkeypatch.setattr(ethernet, "ANSWER_S", 0.0)
        assert way_of(link) is StopWay.LOST
        stops.say(b"\x06\x06")
        lines.say(b"\x06")
        assert link.receive(0.05) == b""
        assert way_of(link) is StopWay.RESERVED


def test_a_stop_goes_the_other_way_when_its_own_connection_is_gone() -> None:
    with connected(reserves_stop=True) as (link, (lines, stops)):
        stops.connection.close()
        assert link.receive(0.05) == b""
        assert way_of(link) is StopWay.LOST
        link.send_urgent(b"\x0b")
        lines.expect(KILL)


def test_a_stop_is_not_lost_with_the_connection_for_lines() -> None:
    with connected(reserves_stop=True) as (link, (lines, stops)):
        lines.connection.close()
        with pytest.raises(LinkError):
            link.receive(5.0)
        link.send_urgent(b"\x0b")
        stops.expect(KILL)


def test_a_stop_does_not_wait_for_a_board_that_does_not_read_and_is_never_half_sent() -> None:
    """So many stops that the network is full: what the board reads in the end are whole requests."""
    with connected() as (link, (board,)):
        link._connection._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
        link.send(b"P1\r")
        began, sent = time.monotonic(), 0
        with pytest.raises(LinkError) as lost:
            while sent < 2_000_000:
                before = time.monotonic()
                link.send_urgent(b"\x0b")
                sent += 1
                assert time.monotonic() - before < 1.0
        assert lost.value.problems[0].code == "link.lost"
        assert time.monotonic() - began < 50.0
        read = b"".join(iter(lambda: board.connection.recv(1_000_000), b""))
    assert read.startswith(response(b"P1"))
    stops = read.removeprefix(response(b"P1"))
    assert stops[: sent * len(KILL)] == KILL * sent
    assert KILL.startswith(stops[sent * len(KILL) :])  # nothing comes behind what may be cut


def test_a_stop_from_a_signal_goes_past_the_thread_that_it_interrupts(both: tuple[EthernetLink, Board]) -> None:
    """The handler comes while this very thread hands over a request."""
    link, board = both
    stop, took_s = StopPath(link), [0.0]

    def handle(number: int, frame: object) -> None:
        began = time.monotonic()
        stop.stop("signal")
        took_s.append(time.monotonic() - began)

    previous = signal.signal(signal.SIGUSR1, handle)
    try:
        with link._requests:
            signal.raise_signal(signal.SIGUSR1)
    finally:
        signal.signal(signal.SIGUSR1, previous)
    board.expect(KILL)
    assert stop.delivered
    assert max(took_s) < 0.5


def test_stops_of_another_thread_never_disturb_the_lines(both: tuple[EthernetLink, Board]) -> None:
    link, board = both
    rounds, ended = 300, threading.Event()

    def answer() -> None:
        """Read request by request, and answer each."""
        while True:
            header = b""
            while len(header) < 8:
                header += board.connection.recv(8 - len(header))
            data = b""
            while len(data) < header[7]:
                data += board.connection.recv(header[7] - len(data))
            board.say(b"\x06" if data == b"\x0b" else data + b"\r\x06")
            if data == b"end":
                return

    def stop_often() -> None:
        while not ended.is_set():
            link.send_urgent(b"\x0b")
            time.sleep(0.0005)

    threads = [threading.Thread(target=answer), threading.Thread(target=stop_often)]
    for thread in threads:
        thread.start()
    for number in range(rounds):
        link.send(b"%d\r" % number)
        expected = b"%d\r\x06" % number
        assert heard(link, len(expected)) == expected
    ended.set()
    threads[1].join(5.0)
    link.send(b"end\r")
    assert heard(link, 5) == b"end\r\x06"
    threads[0].join(5.0)


def test_a_closed_link_says_that_it_is_lost_and_does_not_raise_anything_else() -> None:
    with connected(reserves_stop=True) as (link, _):
        link.close()
        for use in (lambda: link.send(b"P1\r"), lambda: link.receive(0.1), lambda: link.send_urgent(b"\x0b")):
            with pytest.raises(LinkError) as lost:
                use()
            assert lost.value.problems[0].code == "link.lost"
        link.close()
