"""The thread that owns the link: it opens the machine, works the station, and leaves the machine at rest.

Nothing numeric is imported here: the screen is painted first, and what is heavy is loaded in this thread.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from console.session.alarms import Priority, raised
from console.session.state import IDLE, Activity, StationState
from drivers.stop import StopPath
from profiles.problem import Problem, ProblemError

if TYPE_CHECKING:
    from console.session.intents import Intent
    from console.session.station import Station

LOOK_PERIOD_S = 0.1
"""Between two looks at a machine that has nothing to do."""

LEAVE_S = 3.0
"""How long a screen that cannot write to its terminal may take to leave, once the machine rests."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Opened:
    """A machine that was opened: its station, its stop, and how to let go of the link and what is behind it."""

    station: Station
    stop: StopPath
    close: Callable[[], None]


class LinkThread:
    """The real `Control`: everything public returns at once, from any thread and from a signal handler."""

    def __init__(self, machine: str, simulated: bool, open_machine: Callable[[], Opened]) -> None:
        self._open = open_machine
        self._opened: Opened | None = None
        self._unopened = StationState(machine=machine, simulated=simulated)
        self._stopped: str | None = None
        self._ending: str | None = None
        self._must_leave = False
        self._wake = threading.Event()
        self._left = threading.Event()
        # Not a daemon's work, but a daemon: a machine that cannot be reached must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._unopened if self._opened is None else self._opened.station.state

    def now_s(self) -> float:
        """Return machine time."""
        return time.monotonic()

    def start(self) -> None:
        """Begin to open the machine."""
        self._thread.start()

    def post(self, intent: Intent) -> bool:
        """Order something."""
        if self._opened is None:
            return False
        taken = self._opened.station.post(intent)
        self._wake.set()
        return taken

    def stop(self, reason: str) -> None:
        """Stop the machine now; one that is still being opened is stopped before anything else is done with it."""
        self._stopped = self._stopped or reason
        if self._opened is not None:
            self._opened.stop.stop(reason)
        self._wake.set()

    def kill(self, reason: str) -> None:
        """Open every loop now."""
        if self._opened is not None:
            self._opened.stop.kill(reason)
        self._wake.set()

    def beat(self) -> None:
        """The screen is alive."""
        if self._opened is not None:
            self._opened.station.beat()

    def end(self, reason: str, *, must_leave: bool = False) -> None:
        """Leave the machine at rest and end. With `must_leave` the process ends even if the screen cannot."""
        self._ending = self._ending or reason
        self._must_leave = self._must_leave or must_leave
        if self._opened is not None and (self.state.moving or self.state.activity not in IDLE):
            self._opened.stop.stop(reason)
        self._wake.set()

    def join(self, timeout_s: float) -> bool:
        """Wait until the machine was left; False when that takes longer. The screen has left by now."""
        self._left.set()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            opened = self._open()
        except Exception as error:
            self._unopened = _not_opened(self._unopened, error)
        else:
            self._work(opened)
        if self._ending is None:
            self._wait_for_the_end()
        if self._must_leave and not self._left.wait(LEAVE_S):
            # The terminal takes nothing any more and the screen hangs in it; the machine rests.
            os._exit(1)

    def _work(self, opened: Opened) -> None:
        if self._stopped is not None or self._ending is not None:
            opened.stop.stop(self._stopped or self._ending or "")
        self._opened = opened
        try:
            if not opened.station.connect():
                self._wait_for_the_end()
            while self._ending is None:
                opened.station.step()
                self._wake.wait(LOOK_PERIOD_S)
                self._wake.clear()
            opened.station.close(self._ending)
        finally:
            opened.close()

    def _wait_for_the_end(self) -> None:
        while self._ending is None:
            self._wake.wait()
            self._wake.clear()


def _not_opened(state: StationState, error: Exception) -> StationState:
    problems: tuple[Problem, ...]
    if isinstance(error, ProblemError):
        problems = tuple(error.problems)
    else:
        what = " ".join(f"{type(error).__name__}: {error}".split())
        problems = (Problem(code="session.fault", value=what),)
    alarms = state.alarms
    for problem in problems:
        alarms = raised(alarms, problem, Priority.HIGH, time.monotonic())
    return replace(state, activity=Activity.LOST, alarms=alarms)
