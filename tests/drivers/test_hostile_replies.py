"""Every request of the client, and a lathe in motion, at a controller that does not cooperate.

The client has real sockets and pseudo-terminals, with short timeouts. In motion the replies of the simulated card
are spoiled on their way, in simulated time: a stop is sent, and everything comes to rest.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress

import pytest

from drivers.clock import RealClock
from drivers.errors import DriverError, LinkError
from drivers.lathe.snapshot import AxisName
from drivers.link.address import SimulatedAddress, parse_address
from drivers.link.memory import MemoryLink
from drivers.link.opening import open_link
from drivers.pmac import client as client_module
from drivers.pmac import exchange as exchange_module
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC
from drivers.pmac.expected_replies import number_of
from drivers.pmac.status import decode
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.problem import Problem
from profiles.store import load_machine
from tests.hostile.hostile_card import WAYS, End, Kind, Step, Way, hostile_card
from tests.system.lathe_sites import build, compact

SHORT_S = 0.1
ENDS_WITHIN_S = 20.0
IDENTIFIED = 8


def sent_and_awaited(client: PmacClient) -> object:
    client.send("P7=2", SHORT_S)
    return client.reply("P7=2", SHORT_S)


REQUESTS: dict[str, Callable[[PmacClient], object]] = {
    "request": lambda client: client.request("P7=1", SHORT_S),
    "send, reply": sent_and_awaited,
    "query": lambda client: client.query("P1", "P2", timeout_s=SHORT_S),
    "query again": lambda client: client.query("P1", "P2", timeout_s=SHORT_S, again=True),
    "question": lambda client: client.question("LIST PLC1", SHORT_S),
    "numbers": lambda client: client.numbers("P1", "I10", timeout_s=SHORT_S, again=True),
    "download": lambda client: client.download(["OPEN PROG 9 CLEAR", "X1", "CLOSE"]),
    "resynchronise": lambda client: client.resynchronise(SHORT_S),
    "take_messages": lambda client: client.take_messages(),
}

each_way = pytest.mark.parametrize("kind", WAYS, ids=lambda kind: kind.name)
MACHINE = load_machine("lee-2001-lathe").machine


@pytest.fixture(autouse=True)
def short_timeouts(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (client_module, exchange_module):
        monkeypatch.setattr(module, "DRAIN_LIMIT_S", SHORT_S)
        monkeypatch.setattr(module, "REPLY_TIMEOUT_S", SHORT_S)
    monkeypatch.setattr(exchange_module, "CHECKSUM_TIMEOUT_S", SHORT_S)


@pytest.mark.system
@pytest.mark.first(3)
@pytest.mark.parametrize("transport", ["tcp", "serial"])
@each_way
def test_each_request_returns_or_says_why_in_time(kind: Kind, transport: str) -> None:
    """Whatever a request gets, the next one of the same client is sent none the less, or refused with a reason."""
    began_s = time.monotonic()
    for name, request in REQUESTS.items():
        with hostile_card(kind, transport, MACHINE, IDENTIFIED) as card:
            address = parse_address(card.address)
            assert not isinstance(address, SimulatedAddress)
            with closing(open_link(address)) as link:
                client = PmacClient(link, RealClock())
                with suppress(DriverError):
                    client.connect()
                for _ in range(2):
                    with suppress(DriverError):
                        request(client)
                assert len(client._exchange._reader.rest) <= 2 * 65_536
            assert sum(line == "P7=1" for line in card.lines) <= 2, "what writes is sent once for each request"
            assert card.moved_by == [], name
    assert time.monotonic() - began_s < ENDS_WITHIN_S


BLOCK, BLOCK_S = 4096, 0.005
"""Bytes of a flood, and how long they take on their way: no wire is infinitely fast."""


class SpoiledPort:
    """The port of a card, behind a wire that spoils what the card says from `begin` on."""

    def __init__(self, port: Port, sim: SimulatedLathe, way: Way) -> None:
        self.received: list[bytes] = []
        self._port, self._sim, self._way = port, sim, way
        self._spoiled = False
        self._coming: list[tuple[float, bytes]] = []
        self._flood: Iterator[Step] | None = None

    def begin(self) -> None:
        self._spoiled = True

    def receive(self, data: bytes) -> None:
        if self._spoiled:
            self.received.append(data)
        self._port.receive(data)

    def take_output(self) -> bytes:
        data = self._port.take_output()
        if not self._spoiled:
            return data
        if data and self._flood is None:
            self._pass_on(data)
        due = [piece for at_s, piece in self._coming if at_s <= self._sim.now_s()]
        self._coming = [(at_s, piece) for at_s, piece in self._coming if at_s > self._sim.now_s()]
        if self._flood is not None:
            self._sim.wait(BLOCK_S)
            block = next(self._flood)
            assert isinstance(block, bytes)
            due.append(block[:BLOCK])
        return b"".join(due)

    def _pass_on(self, data: bytes) -> None:
        at_s = self._sim.now_s()
        for count, step in enumerate(steps := iter(self._way("P1", data))):
            if isinstance(step, End):
                raise LinkError(Problem(code="link.closed", where="memory"))
            if isinstance(step, float):
                at_s += step
            else:
                self._coming.append((at_s, step))
            if count > 4096 or (isinstance(step, bytes) and len(step) > 60_000):
                self._flood = steps
                return


SERVES_ON_S = 5.0
FAR_COUNTS = 6000.0
"""Of the carriage, some seconds of jogging away."""


def rests(sim: SimulatedLathe) -> bool:
    return all(motor.velocity == 0.0 for motor in sim.controller.motors.values())


@pytest.mark.first(3)
@each_way
def test_a_lathe_in_motion_is_stopped_and_comes_to_rest(kind: Kind) -> None:
    """No second command that moves is sent; a stop is, and what the host does not reach the heartbeat ends."""
    machine = compact("pmac")
    sim = SimulatedLathe(machine)
    port = SpoiledPort(sim.connect(), sim, kind.way())
    site = build(MemoryLink(port, sim), sim, machine)
    lathe = site.lathe
    lathe.connect()
    lathe.claim()
    lathe.confirm_nobody_inside()
    lathe.enable()
    lathe.home()
    began = False

    def begin(_: object) -> None:
        nonlocal began
        if not began and not rests(sim):
            began = True
            port.begin()

    site.seen.append(begin)
    with pytest.raises(DriverError):
        lathe.jog_to(AxisName.CARRIAGE, FAR_COUNTS)
    assert began
    with suppress(DriverError):  # as the session does after any error
        site.stop.stop("machine.fault")
        lathe.wait_for_rest()
    sent = b"".join(port.received)
    assert b"J" not in sent and b"HM" not in sent
    assert b"\x01" in sent or b"\x0b" in sent
    sim.wait(SERVES_ON_S)
    assert rests(sim)


@pytest.mark.parametrize(
    "text", ["nan", "inf", "-inf", "1_0", "1e999", "", "٣", "+-1", "0x10", "$", "$G", "1 0", "$_1"]
)
def test_what_python_takes_for_a_number_and_no_controller_sends_is_none(text: str) -> None:
    """A position that is no number would be neither within the travel nor beyond it."""
    with pytest.raises(ValueError):
        number_of(text)


@pytest.mark.parametrize(
    ("text", "value"),
    [("25", 25.0), ("-1.5", -1.5), ("$C000", 49152.0), ("I5=2", 2.0), (".5", 0.5), ("1E3", 1000.0)],
)
def test_what_a_controller_sends_is_a_number(text: str, value: float) -> None:
    assert number_of(text) == value


@pytest.mark.parametrize("digits", [" 00000812000", "+00000812000", "0_0000812000", "81200081200", "8120008120OO"])
def test_a_status_word_is_hexadecimal_to_its_last_digit(digits: str) -> None:
    with pytest.raises(ValueError):
        decode(digits, PMAC.motor_bits)
