"""Thread that owns the link: it opens the machine, runs the station, and leaves the machine at rest.

Nothing numeric is imported here: the screen is painted first, and heavy modules load in this thread.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from console.session.errors import fault_problem
from console.session.signals import LEAVE_WITHIN_S
from console.session.station.alarms import Priority, raise_alarm
from console.session.station.state import IDLE, Activity, StationState
from profiles.problem import ProblemError

if TYPE_CHECKING:
    from console.session.station.commands import Command
    from console.session.station.link.opening import OpenMachine
    from drivers.clock import TrainingClock
    from drivers.requests.side_line import SideLine

LOOK_PERIOD_S = 0.1  # poll period of an idle machine
CONNECT_AGAIN_S = 0.5  # after which a machine that has never answered may be asked again
LEAVE_S = 3.0  # timeout for a screen that cannot write to its terminal to leave, once the machine is at rest


class LinkThread:
    """The real `Control`: everything public but `join` returns at once, from any thread and a signal handler.

    `give_up` ends the process with an exit code when nothing else can; a test may pass another function. `clock`
    is machine time where that is not real time.
    """

    def __init__(
        self,
        machine: str,
        simulated: bool,
        open_machine: Callable[[], OpenMachine],
        *,
        clock: TrainingClock | None = None,
        leave_s: float = LEAVE_S,
        give_up: Callable[[int], object] = os._exit,
    ) -> None:
        self._open, self._clock = open_machine, clock
        self._leave_s, self._give_up = leave_s, give_up
        self._opened: OpenMachine | None = None
        self._unopened = StationState(machine=machine, simulated=simulated)
        self._may_open = False
        self._stopped: str | None = None
        self._ending: str | None = None
        self._must_leave = False
        self._at_rest = True  # as far as it was ever moved
        # No `Event`: a signal handler could interrupt `Event.set` and then deadlock on itself.
        self._wake: SimpleQueue[None] = SimpleQueue()
        self._finished = threading.Event()
        # Essential work, but a daemon: an unreachable machine must not keep the process alive.
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._unopened if (opened := self._opened) is None else opened.station.state

    @property
    def rested(self) -> bool:
        """Whether the machine was left at rest, as far as it was ever opened."""
        return self._at_rest and self._finished.is_set()

    @property
    def side(self) -> SideLine | None:
        """Where worker threads ask the controller; None before the machine is opened."""
        return None if (opened := self._opened) is None else opened.station.side

    @property
    def run_id(self) -> str | None:
        """The record of the current run, None if there is none."""
        return None if (opened := self._opened) is None else opened.station.run_id

    @property
    def parts(self) -> int:
        """The number of parts that this session has cut to their end."""
        return 0 if (opened := self._opened) is None else opened.station.parts

    def now_s(self) -> float:
        """Return machine time."""
        return time.monotonic() if self._clock is None else self._clock.now_s()

    def start(self) -> None:
        """Start the thread. It opens nothing yet; from now on it ends the process when necessary."""
        self._thread.start()

    def open(self) -> None:
        """Begin to open the machine."""
        self._may_open = True
        self._wake.put(None)

    def post(self, intent: Command) -> bool:
        """Post a command."""
        opened = self._opened
        if opened is None:
            return False
        taken = opened.station.post(intent)
        self._wake.put(None)
        return taken

    def stop(self, reason: str) -> None:
        """Stop the machine now; a machine that is still being opened is stopped before anything else."""
        # Set the flag before checking, where the thread checks in reverse order: one of the two sends it.
        self._stopped = self._stopped or reason
        if self._opened is not None:
            self._opened.stop.stop(reason)
        self._wake.put(None)

    def kill(self, reason: str) -> None:
        """Open every loop now; on a machine that is still being opened, no loop was closed."""
        self._stopped = self._stopped or reason
        if self._opened is not None:
            self._opened.stop.kill(reason)
        self._wake.put(None)

    def beat(self) -> None:
        """Signal that the screen is alive."""
        if self._opened is not None:
            self._opened.station.beat()

    def end(self, reason: str, *, must_leave: bool = False) -> None:
        """Leave the machine at rest and end. With `must_leave` the process ends even if the screen cannot.

        Once is enough: a stop begins the proof of rest anew, and those of further signals would use up its time.
        """
        asked = self._ending is not None and (self._must_leave or not must_leave)
        self._ending = self._ending or reason
        self._must_leave = self._must_leave or must_leave
        if self._clock is not None:
            self._clock.leave()
        if self._opened is not None and not asked:
            stop, state = self._opened.stop, self.state
            if must_leave:
                stop.leave_by_s = min(stop.leave_by_s, self.now_s() + LEAVE_WITHIN_S)
            # A signal may come between a command and its beginning, where nothing is known of it yet.
            if state.controls and (must_leave or state.may_move or state.activity not in IDLE):
                stop.stop(reason)
        self._wake.put(None)

    def join(self, timeout_s: float) -> bool:
        """Wait until the machine was left; False on timeout."""
        return self._finished.wait(timeout_s)

    def _run(self) -> None:
        try:
            self._wait_until(lambda: self._may_open or self._ending is not None)
            if self._ending is None:
                self._work(self._open())
        except Exception as error:
            state, alarms = self.state, self.state.alarms
            for problem in error.problems if isinstance(error, ProblemError) else (fault_problem(error),):
                alarms = raise_alarm(alarms, problem, Priority.HIGH, self.now_s())
            self._unopened = replace(state, activity=Activity.LOST, alarms=alarms)
            self._opened = None
            self._wait_until(lambda: self._ending is not None)
        self._finished.set()
        self._wait_until(lambda: self._must_leave)
        # The process ends, and this thread with it, unless its terminal blocks and it hangs there.
        time.sleep(self._leave_s)
        self._give_up(1)

    def _work(self, opened: OpenMachine) -> None:
        self._opened, self._at_rest = opened, False
        station = opened.station
        try:
            # A process that ends before it knows who controls the machine has moved nothing: a motion is somebody
            # else's.
            if self._stopped is not None:
                opened.stop.stop(self._stopped)
            while self._ending is None and not station.connect():
                self._wait(CONNECT_AGAIN_S)
            while self._ending is None:
                station.step()
                self._wait(LOOK_PERIOD_S if self._clock is None else LOOK_PERIOD_S / max(self._clock.speed, 1.0))
            station.close(self._ending)
            self._at_rest = station.state.activity is not Activity.LOST
        except BaseException:
            if station.state.controls:  # else it moves for another console
                opened.stop.kill("fault")
            raise
        finally:
            opened.close()

    def _wait(self, timeout_s: float | None) -> None:
        with suppress(Empty):
            self._wake.get(timeout=timeout_s)
            while True:
                self._wake.get_nowait()

    def _wait_until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self._wait(None)
