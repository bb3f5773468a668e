"""A served card whose time waits for the console that works it, until a test says that nobody waits any more.

Sockets, lines and the card are those of `console simulator`. While a console works, simulated time runs with real
time, but no further than a moment beyond its last word: however busy the computer is, no lease of a living host
runs out. At a state that a test names time stands still, so that what is done to the console comes at just that
state; from there on time passes only when the test, as another host of the card, lets it pass.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial

from drivers.link.address import TcpAddress
from drivers.link.base import Link, StopWay
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from drivers.pmac.heartbeat.watchdog import GuardedActivity, watchdog_timer
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import ACTIVITY
from drivers.simulator.hosts.connection import HostConnection, PlainStream
from drivers.simulator.hosts.port import Port
from drivers.simulator.hosts.real_time import SLICE_S, Host
from drivers.simulator.hosts.server import Listeners, listen
from drivers.simulator.machine import SimulatedLathe

ANYWHERE = TcpAddress(host="127.0.0.1", port=0)
LISTENERS = {
    "serial": Listeners(pty=True),
    "tcp": Listeners(tcp=ANYWHERE),
    "ethernet": Listeners(ethernet=ANYWHERE),
}

STEP_S = 0.005
"""Simulated time that passes between two looks for a reply, and the most of real time that each look waits."""

SILENCE_S = 0.3
"""Real time without a byte after which there is none: the system takes its time to carry one."""

TIMEOUT_S = 10.0
TURNS = 3
"""Turns of the event loop in which everything that has come is taken: heard of, read, carried out."""


@dataclass(frozen=True, kw_only=True)
class PacedServer:
    """A served lathe; `now_s` and `wait` are its clock."""

    address: str
    lathe: SimulatedLathe
    hosts: set[Host]
    loop: asyncio.AbstractEventLoop

    def now_s(self) -> float:
        return self.lathe.now_s()

    def wait(self, seconds: float) -> None:
        asyncio.run_coroutine_threadsafe(self._advance(seconds), self.loop).result(TIMEOUT_S)

    async def _advance(self, seconds: float) -> None:
        while seconds > 0.0:
            for _ in range(TURNS):
                await asyncio.sleep(0.0)
            self.lathe.wait(min(seconds, SLICE_S))
            seconds -= SLICE_S
            for host in tuple(self.hosts):
                host.flush()


class PacedLink:
    """A real link to such a server: waiting for a reply lets its time pass."""

    def __init__(self, link: Link, server: PacedServer) -> None:
        self.address = link.address
        self.link, self.server = link, server

    @property
    def checks_bytes(self) -> bool:
        return self.link.checks_bytes

    @property
    def stop_way(self) -> StopWay:
        return self.link.stop_way

    def send(self, data: bytes) -> None:
        self.link.send(data)

    def send_urgent(self, data: bytes) -> None:
        self.link.send_urgent(data)

    def receive(self, timeout_s: float) -> bytes:
        began_s, deadline = time.monotonic(), self.server.now_s() + timeout_s
        while not (data := self.link.receive(min(timeout_s, STEP_S))):
            left_s = deadline - self.server.now_s()
            if left_s <= 0.0:
                break
            self.server.wait(min(left_s, STEP_S))
        if data or timeout_s <= 0.0:
            return data
        return self.link.receive(max(began_s + SILENCE_S - time.monotonic(), 0.0))

    def close(self) -> None:
        self.link.close()


@contextmanager
def served(lathe: SimulatedLathe, kind: str) -> Iterator[PacedServer]:
    """Serve a lathe at one listener, in a thread that ends with the block."""
    loop, hosts = asyncio.new_event_loop(), set[Host]()
    thread = threading.Thread(target=loop.run_forever, name=f"paced {kind}")
    thread.start()
    opened = ExitStack()

    async def begin() -> list[str]:
        return [address async for address in listen(lathe, LISTENERS[kind], hosts, opened)]

    async def end() -> None:
        opened.close()

    try:
        (address,) = asyncio.run_coroutine_threadsafe(begin(), loop).result(TIMEOUT_S)
        yield PacedServer(address=address, lathe=lathe, hosts=hosts, loop=loop)
        asyncio.run_coroutine_threadsafe(end(), loop).result(TIMEOUT_S)
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(TIMEOUT_S)
        loop.close()


HEARD_S = 0.15
"""How far time runs on without a word: a lease that was just renewed, 50 ms late, holds beyond that."""

TICK_S = 0.005
LATE_S = 0.1
"""As much of a tick that came late is made up for."""

HURRY = 8.0
"""How much faster than real time it runs where nothing is cut and no lease is being measured by the host."""

UNTIL_S = 40.0


@dataclass
class _Words:
    """What the console has said, with the simulated time of each piece; the card does not hear from `holds` on."""

    said: list[tuple[float, bytes]] = field(default_factory=list)
    holds: bytes | None = None
    held: list[Callable[[], None]] = field(default_factory=list)


class _Heard(PlainStream):
    """The ASCII stream of the console, with an ear."""

    def __init__(self, lathe: SimulatedLathe, port: Port, card: PatientCard) -> None:
        super().__init__(lathe, port)
        self._now_s, self._words, self._catch_up = lathe.now_s, card.words, card.catch_up

    def receive(self, data: bytes) -> None:
        self._catch_up()
        words, pass_on = self._words, partial(super().receive, data)
        words.said.append((self._now_s(), data))
        if words.holds is not None and (words.held or words.holds in data):
            words.held.append(pass_on)
        else:
            pass_on()


class PatientCard:
    """One lathe with two listeners: `console` is for the console under test, the other one for whoever watches."""

    def __init__(self, server: PacedServer) -> None:
        self.server, self.lathe = server, server.lathe
        self.console = ""
        self.words = _Words()
        self._stops_at: Callable[[], bool] | None = None
        self._stands_then = True
        self._reached = asyncio.Event()
        self._runs = True
        self._ended = False
        self._last_s = time.monotonic()

    async def begin(self) -> asyncio.Server:
        """Listen for the console, and let time run with it."""
        loop, hosts = asyncio.get_running_loop(), self.server.hosts
        heard = partial(_Heard, card=self)
        listener = await loop.create_server(lambda: HostConnection(self.lathe, hosts, heard), "127.0.0.1", 0)
        self.console = f"tcp:127.0.0.1:{listener.sockets[0].getsockname()[1]}"
        return listener

    async def keep_time(self) -> None:
        """Let time run with the console, until `end`."""
        self._last_s = time.monotonic()
        while not self._ended:
            await asyncio.sleep(TICK_S)
            real_s = self._passed_s()
            left_s = real_s if self._measured else min(min(real_s, LATE_S) * self._speed, self._waits_s)
            while left_s > 0.0 and self._runs:
                self.lathe.wait(min(left_s, SLICE_S))
                left_s -= SLICE_S
                for host in tuple(self.server.hosts):
                    host.flush()
                await asyncio.sleep(0.0)
                self._look()
            self._look()  # also where time stands, because the console says nothing any more

    def _passed_s(self) -> float:
        last_s, self._last_s = self._last_s, time.monotonic()
        return self._last_s - last_s

    def catch_up(self) -> None:
        """Let a word be heard when it was said, where the console measures time by what is answered."""
        if self._runs and self._measured:
            left_s = self._passed_s()
            while left_s > 0.0:
                self.lathe.wait(min(left_s, SLICE_S))
                left_s -= SLICE_S

    def _look(self) -> None:
        if self._stops_at is not None and self._stops_at():
            self._runs = not self._stands_then
            self._stops_at = None
            self._reached.set()

    @property
    def _waits_s(self) -> float:
        """How long time goes on without another word of the console."""
        heard_s = self.words.said[-1][0] if self.words.said else 0.0
        return heard_s + HEARD_S - self.lathe.now_s()

    @property
    def _measured(self) -> bool:
        """Whether the console holds the rate of the lease against its clock: then no moment may be left out."""
        card = self.lathe.controller
        watchdog = watchdog_timer(card.dialect).name
        guarded = card.variables.get(VariableKind.P, ACTIVITY) != GuardedActivity.NOTHING
        return card.variables.get(VariableKind.M, int(watchdog[1:])) > 0 and not guarded

    @property
    def _speed(self) -> float:
        card = self.lathe.controller
        # The host knows how long an axis takes to come to rest behind the trigger of its zero, and a hurried step
        # of time may have all of that in it.
        homing = any(each.jog.homes and each.jog.stage for each in card.motors.values())
        return 1.0 if homing or card.systems[1].running else HURRY

    def until(self, reached: Callable[[], bool]) -> None:
        """Let time run with the console until something is so; it stands still from then on."""
        self._wait(reached, stands_then=True)

    def sees(self, reached: Callable[[], bool]) -> None:
        """Let time run with the console until something is so, and on."""
        self._wait(reached, stands_then=False)

    def _wait(self, reached: Callable[[], bool], *, stands_then: bool) -> None:
        async def wait() -> None:
            self._stops_at, self._reached, self._stands_then = reached, asyncio.Event(), stands_then
            await asyncio.wait_for(self._reached.wait(), UNTIL_S)

        self._in_loop(wait(), UNTIL_S + TIMEOUT_S)

    def will_not_hear(self, text: bytes) -> None:
        """Keep this, and what comes after it, from the card until `run_on`."""

        async def hold() -> None:
            self.words.holds = text

        self._in_loop(hold(), TIMEOUT_S)

    def until_it_is_said(self) -> None:
        """Let time run until the console says what the card will not hear."""
        self.until(lambda: bool(self.words.held))

    def run_on(self) -> None:
        """Let time run with the console again, and the card hear what was kept from it."""

        async def run() -> None:
            self.words.holds = None
            while self.words.held:
                self.words.held.pop(0)()
            self.words.said.append((self.lathe.now_s(), b""))
            self._runs = True

        self._in_loop(run(), TIMEOUT_S)

    @contextmanager
    def hanging(self) -> Iterator[None]:
        """Let the card neither read nor answer within, while its motors go on."""

        async def begin() -> None:
            self.lathe.faults.inject("hang")

        async def end() -> None:
            self.lathe.faults.clear()

        self._in_loop(begin(), TIMEOUT_S)
        try:
            yield
        finally:
            self._in_loop(end(), TIMEOUT_S)
            self.server.wait(TICK_S)

    def slow_background(self, cycle_ms: float) -> None:
        """Let the card have that fault from now on."""

        async def begin() -> None:
            self.lathe.faults.inject("slow-background", cycle_ms=cycle_ms)

        self._in_loop(begin(), TIMEOUT_S)

    def cut_cable(self, for_s: float) -> None:
        """Cut every connection, and let nobody connect for a while."""

        async def begin() -> None:
            self.lathe.faults.inject("cut-cable", for_s=for_s)

        self._in_loop(begin(), TIMEOUT_S)

    def _in_loop(self, work: object, timeout_s: float) -> None:
        assert asyncio.iscoroutine(work)
        asyncio.run_coroutine_threadsafe(work, self.server.loop).result(timeout_s)

    def end(self) -> None:
        """Time has run long enough."""
        self._ended = True

    @contextmanager
    def watcher(self) -> Iterator[PmacClient]:
        """Connect another host, over a socket of its own; from now on time passes while it waits for replies."""

        async def stand_still() -> None:
            self._runs = False

        self._in_loop(stand_still(), TIMEOUT_S)
        address = self.server.address.removeprefix("tcp:").split(":")
        with closing(open_link(TcpAddress(host=address[0], port=int(address[1])))) as link:
            client = PmacClient(PacedLink(link, self.server), self.server)
            client.connect()
            yield client


@contextmanager
def patient_card(lathe: SimulatedLathe) -> Iterator[PatientCard]:
    """Serve a lathe to one console and to those who watch."""
    with served(lathe, "tcp") as server:
        card = PatientCard(server)
        listener = asyncio.run_coroutine_threadsafe(card.begin(), server.loop).result(TIMEOUT_S)
        pace = asyncio.run_coroutine_threadsafe(card.keep_time(), server.loop)
        try:
            yield card
        finally:
            card.end()
            pace.result(TIMEOUT_S)
            server.loop.call_soon_threadsafe(listener.close)
