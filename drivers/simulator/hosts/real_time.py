"""Keep simulated time in step with real time, for the servers: its delay, and when it waits for the host.

The user interface and its simulator share one computer. When that is overloaded, the interface is delayed, and a
real controller would end a motion, as it must. Here the controller waits, for a limited time, for its only host:
longer silences are real ones.

A checkpoint is a copy of the process that stands still, from which further copies continue. A copy (fork) has
everything as it was, to the bit: controller, plant, part, faults, the state of chance. The frozen one only waits.
It ends when the process that could ask for a copy is gone.
"""

from __future__ import annotations

import asyncio
import math
import os
import signal
import socket
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Collection, Coroutine
from typing import Any, NoReturn, Protocol

from drivers.ending_signals import ENDING_SIGNALS

TICK_S = 0.005
LATE_S = 0.02  # simulated time by which a tick comes late from which on this computer is busy
MOST_CATCH_UP_S = 0.1  # most real time made up for in one tick; a suspended process loses the rest
SLICE_S = 0.01  # simulated time advanced in one go: in between, hosts and signals are served
HEARD_S = 0.18  # how far simulated time runs without input: shorter than a watchdog timeout just renewed
TIMEOUT_S = 2.0  # how long a silence is attributed to the computer
Advance = Callable[[float], None]  # advances the time of a lathe by so many seconds
ASKED = b"!"  # asks a frozen copy for one that goes on; it comes back with the end of a channel to that one
_FIRST = 3  # number of the first file that is none of the standard streams

GoOn = Callable[[socket.socket], None]
"""What a copy does with its channel, until it ends."""


class SimulationPace:
    """How many times as fast as real time simulated time runs; 0 while it is paused. `changed_s` is real time.

    `held_s` is by how much simulated time was behind since the beginning, because this computer was busy.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self.speed, self.changed_s, self.held_s = speed, -math.inf, 0.0

    def set(self, speed: float) -> None:
        """Run this many times as fast from now on."""
        self.speed, self.changed_s = speed, time.monotonic()


class Host(Protocol):
    """A host connected to the controller."""

    def flush(self) -> None:
        """Forward the controller's replies, and resume reading when it has room again; never wait."""


class TerminationSignals:
    """SIGINT, SIGTERM and SIGHUP from now on: `number` is the first that came, None before."""

    def __init__(self) -> None:
        self.number: int | None = None
        self._came = asyncio.Event()
        for number in ENDING_SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as under `nohup`
                asyncio.get_running_loop().add_signal_handler(number, self._set, number)

    async def wait(self) -> None:
        """Return once a signal has come."""
        await self._came.wait()

    def _set(self, number: int) -> None:
        self.number = self.number or number
        self._came.set()


class WallClock:
    """Real time, s."""

    def now_s(self) -> float:
        """Return the time since some fixed start."""
        return time.monotonic()

    async def sleep(self, seconds: float) -> None:
        """Yield to others for at least `seconds`."""
        await asyncio.sleep(seconds)


async def keep_time(
    advance: Advance,
    hosts: Collection[Host],
    *endings: Coroutine[Any, Any, object],
    pace: SimulationPace | None = None,
    lags_s: list[float] | None = None,
) -> None:
    """Keep simulated time in step with real time until one of `endings` is over; raise its error.

    `pace` may change meanwhile; without one it is real time. The delay of each tick is appended to `lags_s`.
    """
    clock = run_clock(advance, hosts, WallClock(), pace or SimulationPace(), lags_s)
    tasks = {asyncio.create_task(work) for work in (clock, *endings)}
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
    for task in done:
        task.result()


async def run_clock(
    advance: Advance,
    hosts: Collection[Host],
    clock: WallClock,
    pace: SimulationPace,
    lags_s: list[float] | None = None,
) -> None:
    """Advance a tick at a time, without an end."""
    last_s = clock.now_s()
    while True:
        await clock.sleep(max(last_s + TICK_S - clock.now_s(), 0.0))
        now_s = clock.now_s()
        if lags_s is not None:
            lags_s.append(now_s - last_s - TICK_S)
        late_s = (now_s - last_s - TICK_S) * pace.speed
        pace.held_s += late_s if late_s > LATE_S else 0.0
        behind_s = min(now_s - last_s, MOST_CATCH_UP_S) * pace.speed
        last_s = now_s
        while behind_s > 0.0 and pace.speed > 0.0:
            advance(min(behind_s, SLICE_S))
            behind_s -= SLICE_S
            for host in tuple(hosts):
                host.flush()
            await clock.sleep(0.0)


def patient(
    advance: Advance,
    heard_s: Callable[[], float | None],
    now_s: Callable[[], float],
    pace: SimulationPace | None = None,
) -> Advance:
    """Skip time while a lathe waits for its host. `heard_s` is the time of its last input, None: never.

    What counts is the time since then, real and simulated; the faster that runs, the less of it: a host that is
    held up for a moment is later in simulated time, and a watchdog is renewed with one input in a few.
    """
    pace = pace or SimulationPace()
    heard, ran_s = heard_s(), 0.0

    def wait(seconds: float) -> None:
        nonlocal heard, ran_s
        last_s = heard_s()
        if last_s != heard:
            heard, ran_s = last_s, 0.0
        silent_s = math.inf if last_s is None else now_s() - last_s
        soon = ran_s <= HEARD_S / max(pace.speed, 1.0) and silent_s <= HEARD_S / min(pace.speed or 1.0, 1.0)
        if soon or silent_s >= TIMEOUT_S:
            ran_s += seconds
            advance(seconds)
        else:
            pace.held_s += seconds

    return wait


def freeze(go_on: GoOn) -> socket.socket:
    """Set a checkpoint: return the line to a frozen copy of this process, as it is now. Raises OSError."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for copies that have ended
    ours, theirs = socket.socketpair()
    try:
        if not _fork():
            _wait(theirs, go_on)
    except OSError:
        ours.close()
        raise
    finally:
        theirs.close()
    return ours


def _wait(line: socket.socket, go_on: GoOn) -> NoReturn:
    """Be the frozen copy: nothing of the original but its memory is used any more, or unwound."""
    try:
        _let_go_of_files(line)
        signal.set_wakeup_fd(-1)
        for number in ENDING_SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:  # as under `nohup`
                signal.signal(number, signal.SIG_DFL)
        while line.recv(1) == ASKED:
            channel, far = socket.socketpair()
            if not _fork():
                _let_go_of_files(channel)
                go_on(channel)
                break
            channel.close()
            socket.send_fds(line, [ASKED], [far.fileno()])
            far.close()
    except OSError:
        pass  # whoever could ask is gone
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(0)


def _let_go_of_files(kept: socket.socket) -> None:
    """Point every open file at nothing but this one; their numbers stay taken: objects that are left have them."""
    nothing = os.open(os.devnull, os.O_RDWR)
    for name in os.listdir("/proc/self/fd"):
        number = int(name)
        if number >= _FIRST and number not in (kept.fileno(), nothing) and _is_open(number):
            os.dup2(nothing, number, inheritable=False)


def _is_open(number: int) -> bool:
    """Whether it is still open: the list of open files was one itself."""
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def _fork() -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads that only numerics have
        return os.fork()
