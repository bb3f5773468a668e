"""A broker that closes, stays silent, or announces too much before it has answered: it is told, and bounded."""

from __future__ import annotations

import socket
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import SimpleQueue

import pytest

from console.site.exchange import publisher
from console.site.exchange.broker import Broker
from console.site.exchange.publisher import CLOSED, NO_ANSWER, Publisher

pytestmark = pytest.mark.system

CONNACK = b"\x20\x02\0\0"  # MQTT 3.1.1, 3.2: accepted
LARGEST = b"\x30\xff\xff\xff\x7f"  # 2.2.3: a PUBLISH of 268 435 455 bytes, the largest that there is
TOLD_S = 20.0

Talk = Callable[[socket.socket], object]
Told = SimpleQueue[tuple[bool, str]]


@contextmanager
def published_to(talk: Talk) -> Iterator[Told]:
    """A publisher at a port where each connection is talked to like this; what it tells."""
    told: Told = SimpleQueue()
    taken: list[socket.socket] = []

    def serve(listening: socket.socket) -> None:
        with suppress(OSError):
            while True:
                taken.append(listening.accept()[0])
                with suppress(OSError):
                    talk(taken[-1])

    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=serve, args=(listening,), daemon=True).start()
        broker = Broker(host="127.0.0.1", port=listening.getsockname()[1])
        made = Publisher(broker, "trilobe/lathe/", lambda *each: told.put(each))
        made.start()
        try:
            yield told
        finally:
            made.close()
            for each in taken:
                each.close()


def close(connection: socket.socket) -> None:
    connection.recv(100)
    connection.close()


def flood(connection: socket.socket) -> None:
    connection.recv(100)
    connection.sendall(CONNACK + LARGEST)
    while True:
        connection.sendall(bytes(1_000_000))


def test_a_port_that_closes_before_it_answers_is_told() -> None:
    with published_to(close) as told:
        assert told.get(timeout=TOLD_S) == (False, CLOSED)


def test_a_port_that_says_nothing_is_told_long_before_it_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(publisher, "ANSWER_S", 0.05)
    with published_to(lambda connection: None) as told:
        assert told.get(timeout=TOLD_S / 2.0) == (False, NO_ANSWER)


def test_a_packet_that_is_too_large_ends_the_connection_and_is_not_kept() -> None:
    tracemalloc.start()
    try:
        with published_to(flood) as told:
            assert told.get(timeout=TOLD_S) == (True, "")
            connected, reason = told.get(timeout=TOLD_S)
            assert not connected and "268435455 bytes" in reason
        _, most_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most_bytes < 20e6
