"""Simulated time in step with real time, for the servers: how late it is, and whom it waits for.

A screen and its simulator share one computer. Where that has too much to do, the screen is held up, and a real
card would end what moves, as it must. Here the card waits, for a while, for the one host that it serves: longer
silences are real ones.
"""

from __future__ import annotations

import asyncio
import math
import signal
import time
from collections import deque
from collections.abc import Callable, Collection, Coroutine
from typing import Any, Protocol

KEPT = 20_000
"""Delays that are kept, the latest: at 5 ms a tick, those of 100 s."""

TICK_S = 0.005
MOST_CATCH_UP_S = 0.1
"""Real time made up for in one tick; a process that was asleep for longer loses the rest."""

SLICE_S = 0.01
"""Simulated time that is advanced in one go: between two, hosts and signals are heard."""

HEARD_S = 0.18
"""How far time runs on without a word of the host: a lease that it has just renewed holds beyond that."""

PATIENCE_S = 2.0
"""How long a silence is put down to the computer."""


class Advanced(Protocol):
    """What has a time that is advanced."""

    def wait(self, seconds: float) -> None:
        """Advance it."""


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


class WallClock:
    """Real time, s."""

    def now_s(self) -> float:
        """Return the time since some fixed start."""
        return time.monotonic()

    async def sleep(self, seconds: float) -> None:
        """Let everybody else have a turn, and `seconds` pass."""
        await asyncio.sleep(seconds)


class LagRecord:
    """Delays in s. It never grows beyond `KEPT`."""

    def __init__(self) -> None:
        self._delays_s: deque[float] = deque(maxlen=KEPT)

    def __len__(self) -> int:
        return len(self._delays_s)

    def add(self, delay_s: float) -> None:
        """Take down one more delay."""
        self._delays_s.append(delay_s)

    def quantile_s(self, share: float) -> float:
        """Return the least delay that `share` (0 to 1) of the delays do not exceed.

        Raises:
            ValueError: nothing has been taken down.
        """
        if not self._delays_s:
            raise ValueError("no delays")
        ordered = sorted(self._delays_s)
        return ordered[max(math.ceil(share * len(ordered)), 1) - 1]


async def keep_time(
    lathe: Advanced,
    hosts: Collection[Host],
    *endings: Coroutine[Any, Any, object],
    speed: float = 1.0,
    lag: LagRecord | None = None,
) -> None:
    """Let simulated time keep up with real time until one of `endings` is over; raise what went wrong.

    Simulated time runs `speed` times as fast. How late each tick comes is taken down in `lag`.
    """
    clock = run_clock(lathe, hosts, WallClock(), speed, LagRecord() if lag is None else lag)
    tasks = {asyncio.create_task(work) for work in (clock, *endings)}
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
    for task in done:
        task.result()


async def run_clock(
    lathe: Advanced, hosts: Collection[Host], clock: WallClock, speed: float, lag: LagRecord
) -> None:
    """Advance a tick at a time, without an end."""
    last_s = clock.now_s()
    while True:
        await clock.sleep(max(last_s + TICK_S - clock.now_s(), 0.0))
        now_s = clock.now_s()
        lag.add(now_s - last_s - TICK_S)
        behind_s = min(now_s - last_s, MOST_CATCH_UP_S) * speed
        last_s = now_s
        while behind_s > 0.0:
            lathe.wait(min(behind_s, SLICE_S))
            behind_s -= SLICE_S
            for host in tuple(hosts):
                host.flush()
            await clock.sleep(0.0)


class PatientTime:
    """Advances a lathe unless its host is being waited for. `heard_s` says when it was last heard, None: never."""

    def __init__(self, lathe: Advanced, heard_s: Callable[[], float | None], now_s: Callable[[], float]) -> None:
        self._lathe, self._heard_s, self._now_s = lathe, heard_s, now_s

    def wait(self, seconds: float) -> None:
        """Advance it, or let the time pass it by."""
        heard_s = self._heard_s()
        if heard_s is None or not HEARD_S < self._now_s() - heard_s < PATIENCE_S:
            self._lathe.wait(seconds)
