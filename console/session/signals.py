"""Signals that end the console: each first stops the machine, where this console controls it."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from console.session.ending_signal import has_come
from console.session.errors import Interrupted
from drivers.clock import FreezeWatch
from drivers.ending_signals import ENDING_SIGNALS
from drivers.lathe.stop import StopPath

LEAVE_WITHIN_S = 6.0
"""How long to wait for rest once this process is asked to end: a supervisor kills it after ten."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _GuardedMachine:
    """A machine, whether another console controls it, and whether a claim or a release is in progress."""

    stop: StopPath
    anothers: Callable[[], bool]
    changing: Callable[[], bool]
    now_s: Callable[[], float] | None


class Interruption:
    """Turn a signal into a stop of the guarded machine.

    Installed before the numerics are loaded. With a machine the handler only sends the stop: the session then
    sees it, waits for rest, and leaves. Before there is a machine, and while another console controls it, nothing
    is sent, and the command ends at once. A signal during a claim is noted: the session sees it as a stop as soon
    as the claim is answered.

    Ctrl-C comes from an operator who is watching: wait for rest as long as it takes, until a second Ctrl-C. Any
    other signal comes from somebody who does not wait: `hurried_s` is when it came, in seconds of
    `time.monotonic`, None before.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self.hurried_s: float | None = None
        self._guarded: _GuardedMachine | None = None
        self._holds = False
        self._freezes: FreezeWatch | None = None

    def install(self) -> None:
        """Install the signal handlers, and watch for a pause in which this process does not run."""
        self._freezes = FreezeWatch()
        for number in ENDING_SIGNALS:
            signal.signal(number, self._handle)

    def guard(
        self,
        stop: StopPath,
        *,
        anothers: Callable[[], bool] = lambda: False,
        changing: Callable[[], bool] = lambda: False,
        now_s: Callable[[], float] | None = None,
    ) -> None:
        """Stop this machine on a signal from now on, unless it is `anothers`; at once if one has already come.

        With `now_s`, machine time, the wait for its rest ends when there is no time for it.
        """
        self._guarded = _GuardedMachine(stop=stop, anothers=anothers, changing=changing, now_s=now_s)
        if now_s is not None:
            stop.freezes = self._freezes
        if self.reason is not None:
            self.end(self.reason)

    @contextmanager
    def holding(self) -> Iterator[None]:
        """Defer signals until an operation that must not end half done is complete; then raise Interrupted."""
        self._holds = True
        try:
            yield
        finally:
            self._holds = False
        if self.reason is not None:
            raise Interrupted(self.reason)

    def end(self, reason: str) -> None:
        """Stop the guarded machine; also for events that are no signals, such as a lost terminal.

        Raises:
            Interrupted: there is no machine yet, or another console controls it: nothing was sent.
        """
        self.reason = self.reason or reason
        guarded = self._guarded
        if self._holds:
            return
        if guarded is None:
            raise Interrupted(self.reason)
        if self.hurried_s is not None and guarded.stop.reason is not None:
            return  # each stop begins the proof of rest anew, and is repeated until then
        hurried = reason != signal.SIGINT.name or guarded.stop.reason is not None
        if hurried and self.hurried_s is None:
            self.hurried_s = time.monotonic()
            if guarded.now_s is not None:
                guarded.stop.leave_by_s = guarded.now_s() + LEAVE_WITHIN_S
        if guarded.changing():
            guarded.stop.note(self.reason)
        elif not guarded.anothers():
            guarded.stop.stop(self.reason)
        elif guarded.stop.reason is None:
            raise Interrupted(self.reason)
        else:
            guarded.stop.note(self.reason)  # our own stop is still being followed until rest

    def _handle(self, number: int, _: FrameType | None) -> None:
        self.end(has_come(number))
