"""The simulator's real listeners in a thread, with a time that stands still unless a host lets it pass.

Links, sockets and pseudo-terminals are those of `console simulator`. What differs is the clock: however busy the
computer is, no lease runs out and no cut is over before somebody has looked.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from drivers.link.address import TcpAddress
from drivers.link.base import Link, StopWay
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
