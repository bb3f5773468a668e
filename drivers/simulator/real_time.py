"""Simulated time in step with real time, for the servers: what they share beside their hosts."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Collection, Coroutine
from typing import Any, Protocol

from drivers.simulator.machine import SimulatedLathe

TICK_S = 0.005
MOST_CATCH_UP_S = 0.1
"""Simulated time made up for in one tick; a process that was asleep for longer loses the rest."""

UNREAD_LIMIT = 1_000_000
"""Bytes of replies that are kept for a host that does not read."""


class Host(Protocol):
    """Whoever is connected to the card."""

    def flush(self) -> None:
        """Pass on what the card has answered, and read on when it has room again; never wait."""


def ending_signals() -> asyncio.Event:
    """Return an event that SIGINT, SIGTERM and SIGHUP set from now on."""
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    return ended


async def keep_time(lathe: SimulatedLathe, hosts: Collection[Host], *endings: Coroutine[Any, Any, object]) -> None:
    """Let simulated time keep up with real time until one of `endings` is over; raise what went wrong."""
    tasks = {asyncio.create_task(work) for work in (_run_clock(lathe, hosts), *endings)}
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
    for task in done:
        task.result()


async def _run_clock(lathe: SimulatedLathe, hosts: Collection[Host]) -> None:
    """Advance a tick at a time: between two, hosts and signals are heard."""
    last = time.monotonic()
    while True:
        await asyncio.sleep(TICK_S)
        now = time.monotonic()
        behind_s = min(now - last, MOST_CATCH_UP_S)
        last = now
        while behind_s > 0.0:
            lathe.wait(min(behind_s, TICK_S))
            behind_s -= TICK_S
            for host in tuple(hosts):
                host.flush()
            await asyncio.sleep(0)
