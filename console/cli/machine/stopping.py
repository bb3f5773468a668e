"""Progress of a stop on stderr, and the end of the process when the controller no longer answers.

A silent controller blocks whoever queries it. So a second thread beside the one that operates the machine
reports each second what was tried, repeats the stop while the other waits, and ends the process in time.
"""

from __future__ import annotations

import os
import select
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from console.escaping import escaped_line
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath

TICK_S = 0.1
TELL_S, OFTEN_S, LATER_S = 1.0, 4.5, 10.0  # each second at first, then every ten
REPEAT_S = 0.2
SILENT_S = 1.0
"""Longer than any poll of a machine that answers; a stop in between would disturb the proof of rest."""

END_WITHIN_S = 8.5
"""Time from a signal to the end of the process, whatever blocks it: a supervisor kills it after ten seconds."""


class StopMonitor:
    """Monitor one stop path. All its times are real, in seconds of `time.monotonic`."""

    def __init__(
        self,
        interruption: Interruption,
        text: Catalogue,
        *,
        now_s: Callable[[], float] = time.monotonic,
        say: Callable[[str], None] | None = None,
        give_up: Callable[[int], object] = os._exit,
    ) -> None:
        """`say` takes a line, `give_up` ends the process; a test may pass other functions."""
        self._interruption, self._text = interruption, text
        self._now_s, self._say, self._give_up = now_s, say or _to_stderr, give_up
        self._seen_s = self._sent_s = now_s()
        self._began_s: float | None = None
        self._first = self._count = 0
        self._reported_s = 0.0

    def note_reply(self, _: Snapshot) -> None:
        """Note a reply of the controller; called from the thread that operates the machine."""
        self._seen_s = self._now_s()

    @contextmanager
    def watching(self, stop: StopPath, *, ends_only: bool = False) -> Iterator[None]:
        """Monitor the block; `ends_only` where stops are measured, which nothing must disturb."""
        over = threading.Event()

        def watch() -> None:
            while not over.wait(TICK_S):
                self.tick(stop, ends_only=ends_only)

        threading.Thread(target=watch, name="stopping", daemon=True).start()
        try:
            yield
        finally:
            over.set()
            if stop.proven:
                self.tick(stop, ends_only=ends_only)

    def tick(self, stop: StopPath, *, ends_only: bool = False) -> None:
        """Do what is due."""
        now_s = self._now_s()
        if stop.reason is None or stop.proven:
            if stop.proven and self._began_s is not None and self._reported_s > self._began_s:
                self._say(self._text("stopping.rest", seconds=int(now_s - self._began_s)))
            self._began_s = None
        elif not ends_only:
            if self._began_s is None:
                self._began_s = self._reported_s = self._sent_s = now_s
                self._first, self._count = stop.count - 1, stop.count
                self._say(self._text("stopping.begun", stop=self._name_stop(stop)))
            self._repeat(stop, now_s)
            due_s = TELL_S if self._reported_s - self._began_s < OFTEN_S else LATER_S
            if now_s - self._reported_s >= due_s - 0.5 * TICK_S:
                self._reported_s = max(self._reported_s + due_s, now_s - due_s)
                self._tell(stop, now_s - self._began_s, now_s - self._seen_s)
        hurried_s = self._interruption.hurried_s
        if hurried_s is not None and now_s - hurried_s > END_WITHIN_S:
            self._end(stop, now_s - hurried_s)

    def _repeat(self, stop: StopPath, now_s: float) -> None:
        """Repeat the stop where nothing else does; arriving polls prove rest, and must not be disturbed."""
        if stop.count == self._count:
            if now_s - self._seen_s <= SILENT_S or now_s - self._sent_s < REPEAT_S:
                return
            stop.repeat()
        self._sent_s, self._count = now_s, stop.count

    def _tell(self, stop: StopPath, since_s: float, silent_s: float) -> None:
        facts = {"seconds": int(since_s), "count": stop.count - self._first, "stop": self._name_stop(stop)}
        if not stop.delivered:
            line = self._text("stopping.untaken", **facts)
        elif silent_s > SILENT_S:
            line = self._text("stopping.silent", silent=int(silent_s), **facts)
        else:
            line = self._text("stopping.answers", **facts)
        self._say(line)

    def _end(self, stop: StopPath, seconds: float) -> None:
        proven = stop.proven
        if not proven:
            stop.repeat()
        key = "stopping.left" if proven else "stopping.abandoned"
        self._say(self._text(key, reason=self._interruption.reason, seconds=int(seconds)))
        self._give_up(1)

    def _name_stop(self, stop: StopPath) -> str:
        return self._text("stopping.kill" if stop.killed else "stopping.abort")


def _to_stderr(line: str) -> None:
    """Write a line, bypassing other writers that may block; without buffer space, drop it."""
    with suppress(OSError, ValueError):
        number = sys.__stderr__.fileno() if sys.__stderr__ is not None else 2
        if select.select([], [number], [], 0.0)[1]:
            os.write(number, f"console: {escaped_line(line)}\n".encode(errors="replace"))
