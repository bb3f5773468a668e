"""Signals that end the console: each of them stops the machine first, where it is this console that moves it."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from console.session.errors import Interrupted
from drivers.lathe.stop import StopPath

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

LEAVE_WITHIN_S = 6.0
"""How long rest is waited for once somebody wants this process to end: who supervises it kills it after ten."""


def _never() -> bool:
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Guarded:
    """A machine, whether another console controls it, and whether a claim or a release is on its way just now."""

    stop: StopPath
    anothers: Callable[[], bool]
    changing: Callable[[], bool]
    now_s: Callable[[], float] | None


class Interruption:
    """Turns a signal into a stop of whatever machine is being guarded.

    Installed before the numerics are loaded. With a machine the handler only sends the stop: the session then
    sees it, waits for rest, and leaves. Before there is a machine, and while another console controls it, nothing
    is sent, and the command ends at once. One that comes while a claim is on its way is noted: the session sees it
    as a stop as soon as the claim is answered.

    Ctrl-C is an operator, who sees what goes on: rest is waited for as long as it may take, and one more says not
    to. Any other end comes from somebody who does not wait: `hurried_s` is when it came, in seconds of
    `time.monotonic`, None before.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self.hurried_s: float | None = None
        self._guarded: _Guarded | None = None
        self._holds = False

    def install(self) -> None:
        """Take over the signals."""
        for number in ENDING_SIGNALS:
            signal.signal(number, self._handle)

    def guard(
        self,
        stop: StopPath,
        *,
        anothers: Callable[[], bool] = _never,
        changing: Callable[[], bool] = _never,
        now_s: Callable[[], float] | None = None,
    ) -> None:
        """Stop this machine from now on, unless it is `anothers`; at once if a signal has already come.

        With `now_s`, machine time, its rest is not waited for when there is no time for it.
        """
        self._guarded = _Guarded(stop=stop, anothers=anothers, changing=changing, now_s=now_s)
        if self.reason is not None:
            self.end(self.reason)

    @contextmanager
    def holding(self) -> Iterator[None]:
        """Let what must not end half done come to its end first; a signal that has come then ends the command.

        Raises:
            Interrupted: behind it.
        """
        self._holds = True
        try:
            yield
        finally:
            self._holds = False
        if self.reason is not None:
            raise Interrupted(self.reason)

    def end(self, reason: str) -> None:
        """Stop the guarded machine; also for what is no signal, such as a terminal that is gone.

        Raises:
            Interrupted: there is no machine yet, or another console controls it: nothing was sent.
        """
        self.reason = self.reason or reason
        guarded = self._guarded
        if self._holds:
            return
        if guarded is None:
            raise Interrupted(self.reason)
        if reason != signal.SIGINT.name or guarded.stop.reason is not None:
            self._hurry(guarded)
        if guarded.changing():
            guarded.stop.note(self.reason)
        elif not guarded.anothers():
            guarded.stop.stop(self.reason)
        elif guarded.stop.reason is None:
            raise Interrupted(self.reason)
        else:
            guarded.stop.note(self.reason)  # what we have stopped is still being seen to rest

    def _hurry(self, guarded: _Guarded) -> None:
        if self.hurried_s is None:
            self.hurried_s = time.monotonic()
            if guarded.now_s is not None:
                guarded.stop.leave_by_s = guarded.now_s() + LEAVE_WITHIN_S

    def _handle(self, number: int, _: FrameType | None) -> None:
        self.end(signal.Signals(number).name)
