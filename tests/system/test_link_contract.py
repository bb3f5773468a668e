"""What every link promises, over memory, a serial line, TCP and Ethernet, with a card of either family."""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import pytest

from drivers.clock import Clock, RealClock
from drivers.errors import ControllerError, LinkError
from drivers.link.address import EthernetAddress, SerialAddress, TcpAddress
from drivers.link.base import GONE, Link, StopWay
from drivers.link.memory import MemoryLink
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

ABORT, KILL, FLUSH = b"\x01", b"\x0b", b"\x18"
TIMEOUT_S = 10.0
OPTIONS = ("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0", "--pty", "--control", "tcp:127.0.0.1:0")
WIRED = ("serial", "tcp", "ethernet", "ethernet with a connection for stops")
SPINDLE = b"#2"


@dataclass(frozen=True, kw_only=True)
class Site:
    """One way to a simulated card, and the control of its faults."""

    connect: Callable[[], Link]
    fault: Callable[[str], object]
    clock: Clock


@pytest.fixture(scope="module", params=["pmac", pytest.param("turbo", marks=pytest.mark.long)])
def served(request: pytest.FixtureRequest, serve: Serve) -> Iterator[Served]:
    with serve(*OPTIONS, "--dialect", request.param) as running:
        yield running


@pytest.fixture
def family(request: pytest.FixtureRequest) -> str:
    """The family of the card that is served."""
    return str(request.node.callspec.params["served"])


@pytest.fixture(params=["memory", *WIRED])
def site(request: pytest.FixtureRequest, served: Served, family: str) -> Iterator[Site]:
    kind: str = request.param
    if kind == "memory":
        yield in_memory(family)
        return
    yield wired(served, kind)
    tell(served, "clear")
    tell(served, "power-cycle")


@pytest.fixture
def link(site: Site) -> Iterator[Link]:
    with opened(site) as link:
        yield link


def in_memory(family: str) -> Site:
    lathe = load_machine("lee-2001-lathe").machine
    sim = SimulatedLathe(replace(lathe, controller=replace(lathe.controller, family=family)))

    def fault(line: str) -> None:
        name, *rest = line.removeprefix("inject ").split()
        named = dict(item.split("=") for item in rest)
        length = named.pop("for", None)
        values: dict[str, Any] = {key: float(value) for key, value in named.items()}
        sim.faults.inject(name, for_s=None if length is None else float(length), **values)

    return Site(connect=lambda: MemoryLink(sim.connect(), sim), fault=fault, clock=sim)


def wired(served: Served, kind: str) -> Site:
    def connect() -> Link:
        if kind == "serial":
            return open_link(SerialAddress(device=served.device))
        host, port = served.tcp if kind == "tcp" else served.ethernet
        if kind == "tcp":
            return open_link(TcpAddress(host=host, port=port))
        return open_link(EthernetAddress(host=host, port=port, reserves_stop=kind.endswith("stops")))

    return Site(connect=connect, fault=lambda line: tell(served, line), clock=RealClock())


def tell(served: Served, line: str) -> None:
    host, _, port = served.control.removeprefix("tcp:").rpartition(":")
    with closing(socket.create_connection((host, int(port)), timeout=TIMEOUT_S)) as control:
        control.sendall(f"{line}\n".encode())
        control.shutdown(socket.SHUT_WR)
        said = b"".join(iter(lambda: control.recv(4096), b""))
    assert said.endswith(b"ok\n"), said


@contextmanager
def opened(site: Site) -> Iterator[Link]:
    link = site.connect()
    try:
        resynchronise(link)
        yield link
    finally:
        link.close()


def drain(link: Link) -> None:
    while link.receive(0.15):
        pass


def resynchronise(link: Link) -> None:
    link.send(FLUSH)
    drain(link)
    link.send(b"I3=2 I6=1\r")
    drain(link)


def reply(link: Link, clock: Clock) -> bytes:
    """Read up to the end of a reply, and no further."""
    said, deadline = b"", clock.now_s() + TIMEOUT_S
    while not (said.endswith(b"\x06") or (b"\x07" in said and said.endswith(b"\r"))):
        assert clock.now_s() < deadline, said
        said += link.receive(0.5)
    return said


def ask(link: Link, site: Site, line: bytes) -> bytes:
    link.send(line + b"\r")
    return reply(link, site.clock)


def velocity(link: Link, site: Site) -> float:
    return float(ask(link, site, SPINDLE + b"V").removesuffix(b"\r\x06"))


def turn_the_spindle(link: Link, site: Site) -> None:
    assert ask(link, site, SPINDLE + b"J/") == b"\x06"
    assert ask(link, site, SPINDLE + b"J+") == b"\x06"
    wait_until(site, lambda: abs(velocity(link, site)) > 5.0)


def wait_until(site: Site, condition: Callable[[], bool]) -> None:
    deadline = site.clock.now_s() + TIMEOUT_S
    while not condition():
        assert site.clock.now_s() < deadline


def test_lines_are_answered_with_their_data_an_ack_or_an_error(link: Link, site: Site) -> None:
    assert ask(link, site, b"P1..3=25") == b"\x06"
    assert ask(link, site, b"P1..3") == b"25\r25\r25\r\x06"
    assert ask(link, site, b"UUU") == b"\x07ERR003\r"
    assert ask(link, site, b"P1=26 P1") == b"26\r\x06"


def test_an_answer_of_thousands_of_bytes_is_whole(link: Link, site: Site) -> None:
    assert ask(link, site, b"P0..1000=42") == b"\x06"
    assert ask(link, site, b"P0..1000") == b"42\r" * 1001 + b"\x06"


def test_two_lines_in_one_go_are_answered_in_their_order(link: Link, site: Site) -> None:
    link.send(b"P1=1 P1\rP1=2 P1\r")
    said, deadline = b"", site.clock.now_s() + TIMEOUT_S
    while said.count(b"\x06") < 2:
        assert site.clock.now_s() < deadline
        said += link.receive(0.5)
    assert said == b"1\r\x062\r\x06"


def test_a_line_may_be_handed_over_in_parts(link: Link, site: Site) -> None:
    for part in (b"P1", b"=", b"7 P", b"1", b"\r"):
        link.send(part)
    assert reply(link, site.clock) == b"7\r\x06"


def test_after_a_flush_nothing_of_before_is_heard(link: Link, site: Site) -> None:
    ask(link, site, b"P1=1 P2=2")
    link.send(b"P1\rP1")
    link.send(FLUSH)
    drain(link)
    assert ask(link, site, b"P2") == b"2\r\x06"


def test_receiving_waits_no_longer_than_it_was_told(link: Link, site: Site) -> None:
    began = site.clock.now_s()
    assert link.receive(0.1) == b""
    assert link.receive(-1.0) == b""
    assert 0.0999 <= site.clock.now_s() - began < 1.0


def test_a_stop_stops_and_is_not_answered(link: Link, site: Site) -> None:
    turn_the_spindle(link, site)
    link.send_urgent(ABORT)
    wait_until(site, lambda: velocity(link, site) == 0.0)
    drain(link)
    assert ask(link, site, b"P1=5 P1") == b"5\r\x06"


def test_a_stop_while_a_reply_is_pending_stops_and_leaves_the_reply_alone(link: Link, site: Site) -> None:
    turn_the_spindle(link, site)
    ask(link, site, b"P0..1000=42")
    link.send(b"P0..1000\r")
    link.send_urgent(ABORT)
    first = link.receive(0.5)
    link.send_urgent(ABORT)
    rest = b"" if first.endswith(b"\x06") else reply(link, site.clock)
    assert first + rest == b"42\r" * 1001 + b"\x06"
    wait_until(site, lambda: velocity(link, site) == 0.0)
    assert ask(link, site, b"P1=5 P1") == b"5\r\x06"


def test_a_client_gets_to_know_the_card_and_is_in_step(link: Link, site: Site, family: str) -> None:
    client = PmacClient(link, site.clock)
    client.connect()
    assert client.dialect.name == family
    client.request("P1=25")
    for _ in range(5):
        link.send_urgent(KILL)
        assert client.numbers("P1", "P1") == (25.0, 25.0)
    with pytest.raises(ControllerError) as refused:
        client.request("UUU")
    assert refused.value.error_number == 3
    assert client.faults.total == 0


def test_split_segments_change_nothing(link: Link, site: Site) -> None:
    ask(link, site, b"P0..1000=42")
    site.fault("inject split-segments pieces=7 gap_ms=5")
    for number in range(5):
        assert ask(link, site, b"P1=%d P1" % number) == b"%d\r\x06" % number
        link.send_urgent(KILL)
    assert ask(link, site, b"P2..1000") == b"42\r" * 999 + b"\x06"
    assert ask(link, site, b"UUU") == b"\x07ERR003\r"


def test_a_card_that_hangs_is_silent_and_takes_the_stop_when_it_wakes(link: Link, site: Site) -> None:
    turn_the_spindle(link, site)
    site.fault("inject hang for=0.5")
    link.send(b"P1=1 P1\r")
    link.send_urgent(ABORT)
    assert link.receive(0.1) == b""
    assert reply(link, site.clock) == b"1\r\x06"
    wait_until(site, lambda: velocity(link, site) == 0.0)


def connects(site: Site) -> bool:
    site.clock.wait(0.05)
    try:
        with opened(site) as link:
            return ask(link, site, b"P1=1 P1") == b"1\r\x06"
    except LinkError:
        return False


def test_a_cut_cable_is_a_link_that_is_gone_until_it_is_made_anew(link: Link, site: Site) -> None:
    site.fault("inject cut-cable for=0.3")
    deadline = site.clock.now_s() + TIMEOUT_S
    with pytest.raises(LinkError) as lost:
        while site.clock.now_s() < deadline:
            link.send(b"P1\r")
            link.receive(0.2)
    assert lost.value.problems[0].code in GONE
    with pytest.raises(LinkError) as lost:
        for _ in range(3):
            link.send_urgent(KILL)
    assert lost.value.problems[0].code in GONE
    link.close()
    wait_until(site, lambda: connects(site))


@pytest.fixture(params=WIRED)
def real(request: pytest.FixtureRequest, served: Served) -> Site:
    """Threads and signals need time that passes by itself."""
    return wired(served, request.param)


def test_stops_of_another_thread_leave_every_answer_right(real: Site) -> None:
    ended = threading.Event()

    def stop_often(link: Link) -> None:
        while not ended.is_set():
            link.send_urgent(KILL)
            time.sleep(0.001)

    with opened(real) as link:
        stops = threading.Thread(target=stop_often, args=(link,))
        ask(link, real, b"P2..1000=42")
        stops.start()
        try:
            for number in range(100):
                assert ask(link, real, b"P1=%d P1" % number) == b"%d\r\x06" % number
                if number % 25 == 0:
                    assert ask(link, real, b"P2..1000") == b"42\r" * 999 + b"\x06"
        finally:
            ended.set()
            stops.join(TIMEOUT_S)
        assert ask(link, real, b"P1") == b"99\r\x06"


def test_stops_from_a_signal_handler_leave_every_answer_right(real: Site) -> None:
    stopped = 0

    def handle(number: int, frame: object) -> None:
        nonlocal stopped
        link.send_urgent(KILL)
        stopped += 1

    def signal_often() -> None:
        while not ended.wait(0.002):
            os.kill(os.getpid(), signal.SIGUSR1)

    ended, signals = threading.Event(), threading.Thread(target=signal_often)
    with opened(real) as link:
        previous = signal.signal(signal.SIGUSR1, handle)
        signals.start()
        try:
            number = 0
            while stopped < 20:
                number += 1
                assert ask(link, real, b"P1=%d P1" % number) == b"%d\r\x06" % number
        finally:
            ended.set()
            signals.join(TIMEOUT_S)
            signal.signal(signal.SIGUSR1, previous)
        assert ask(link, real, b"P1") == b"%d\r\x06" % number


def test_only_a_board_that_was_asked_has_a_connection_for_stops(
    real: Site, request: pytest.FixtureRequest
) -> None:
    with opened(real) as link:
        asked = request.node.callspec.params["real"].endswith("stops")
        assert link.stop_way is (StopWay.RESERVED if asked else StopWay.DIRECT)
