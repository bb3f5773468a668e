"""Log of a run beside its events: telemetry, commands, alarms. A thread of its own writes it; nobody waits for it.

The queue is bounded; what does not fit, or cannot be written, is counted and reported once, and the cut continues.
Each block is on disk within a second of its first row.
"""

from __future__ import annotations

import json
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from console.session.data.kept_files import RunDates
from console.session.data.record_file import FILE_NAME, WAIT_S, connect_records, is_busy, retrying, transaction
from console.session.data.run_story import GATHERED, MACHINE_S, POLLED, TELEMETRY_END
from drivers.clock import boot_s
from profiles.files import printable
from profiles.problem import Problem

PERIOD_S = 0.4
"""Time between two writes."""

MOST_WAITING = 20_000
"""Polls that may wait: minutes of a real cut, and of a simulated one seconds on a busy disk."""

MOST_UNWRITTEN = 5_000
"""Blocks and events that wait while other writers keep the file: half an hour of a cut."""

WRITE_TIMEOUT_S = 5.0
CLOSE_TIMEOUT_S = 6.0

Rows = NDArray[np.floating]
Poll = tuple[float, ...]
MakeRows = Callable[[Sequence[Poll]], Rows]
"""Turns polls, as they were taken, into rows of `TELEMETRY_COLUMNS`; called in the thread, in order."""

_EVENT = "INSERT INTO events SELECT ?, 1 + coalesce(max(number), 0), ?, ?, ? FROM events WHERE run_id = ?"
_BLOCK = "INSERT INTO telemetry SELECT ?, 1 + coalesce(max(number), 0), ?, ?, ?, ? FROM telemetry WHERE run_id = ?"


@dataclass(frozen=True, slots=True)
class _Event:
    at_utc: str
    machine_s: float
    kind: str
    work: Callable[[], Mapping[str, object] | None]


@dataclass(frozen=True, slots=True)
class _Begin:
    at_utc: str
    part: str
    make_rows: MakeRows


@dataclass(frozen=True, slots=True)
class _GatheredRows:
    at_utc: str
    part: str
    rows: Rows


_Item = _Event | _Begin | _GatheredRows | Poll
_Statement = tuple[str, tuple[object, ...]]


class RunLog:
    """Log of one run. All but `close` return at once; the thread begins with the first item."""

    def __init__(
        self,
        folder: Path,
        run_id: str,
        *,
        most_waiting: int = MOST_WAITING,
        waits_s: float = CLOSE_TIMEOUT_S,
        now_s: Callable[[], float] = boot_s,
    ) -> None:
        """At the end it is waited for `waits_s` for other writers; `now_s`: machine time."""
        self._waits_s = waits_s
        self._folder, self._run_id, self._most_waiting = folder, run_id, most_waiting
        self.dates = RunDates(now_s)
        self._waiting: deque[_Item] = deque()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._cut: _Begin | None = None
        self._kept = self._lost = 0  # rows of telemetry, and items
        self._written = self._unsure = 0  # rows that are on disk, and items that are not yet
        self._unwritten: list[_Statement] = []  # while others keep the file
        self._dropped = 0  # counted by who adds; all else belongs to the thread
        self._reason = ""

    @property
    def problem(self) -> Problem | None:
        """What is missing from the record, `record.incomplete`; None while nothing is."""
        if not self._reason and not self._dropped:
            return None
        missing = self._lost + self._dropped
        return Problem(code="record.incomplete", value=self._reason or "queue full", limit=str(missing))

    def event(self, kind: str, data: Mapping[str, object]) -> None:
        """Add an event that need not be on disk before the run continues."""
        self.event_of(kind, lambda: data)

    def event_of(self, kind: str, work: Callable[[], Mapping[str, object] | None]) -> None:
        """Add an event whose values are worked out in the thread, within some seconds; None is no event."""
        self._put(_Event(self.dates.now(), self.dates.machine_s(), kind, work))

    def begin_cut(self, part: str, make_rows: MakeRows) -> None:
        """Begin the telemetry of a cut."""
        self._put(_Begin(self.dates.now(), part, make_rows))

    def poll(self, poll: Poll) -> None:
        """Add a poll of the cut."""
        self._put(poll)

    def add_window(self, part: str, rows: Rows) -> None:
        """Add a window that the controller has sampled, rows of `GATHERED_COLUMNS`."""
        self._put(_GatheredRows(self.dates.now(), part, rows))

    def end_cut(self) -> None:
        """End the telemetry of the cut; the record then says how much there is of it."""
        self.event_of(TELEMETRY_END, self._end_of_cut)

    def close(self) -> None:
        """Write what waits."""
        if self._waiting and (self._thread is None or not self._thread.is_alive()):
            self._start()
        self._closing.set()
        if self._thread is not None:
            self._thread.join(self._waits_s)
            if self._thread.is_alive():
                self._reason = self._reason or "timeout"

    def _put(self, item: _Item) -> None:
        if len(self._waiting) >= self._most_waiting:
            self._dropped += 1
            return
        self._waiting.append(item)
        if self._thread is None or not self._thread.is_alive():  # a copy of this process has no thread yet
            self._start()

    def _start(self) -> None:
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="run log", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        ending = False
        while not ending or self._unwritten:
            # Not woken by what is added: that would be a lock between the thread that cuts and this one.
            ending = self._closing.wait(PERIOD_S)
            if self._waiting or self._unwritten:
                self._write_waiting()

    def _write_waiting(self) -> None:
        """Write what waits as one transaction; a failure loses it, and is kept for `problem`.

        What other writers keep from being written is written with the next.
        """
        items = [self._waiting.popleft() for _ in range(len(self._waiting))]
        self._unsure += len(items)
        try:
            self._unwritten += self._statements(items)
            self._write(self._unwritten)
            self._written = self._kept
        except Exception as error:
            if isinstance(error, sqlite3.Error) and is_busy(error) and len(self._unwritten) < MOST_UNWRITTEN:
                return
            # No fault of the log may end a cut; it is reported.
            self._reason = self._reason or printable(str(error) or type(error).__name__, 80)
            self._kept, self._lost = self._written, self._lost + self._unsure
        self._unwritten, self._unsure = [], 0

    def _write(self, statements: Sequence[_Statement]) -> None:
        path = self._folder / FILE_NAME
        # For each write: what was removed or replaced meanwhile is found, and a full disk gets free again.
        with closing(connect_records(path, "rw", WAIT_S)) as database:
            database.execute("PRAGMA synchronous=NORMAL")  # others wait for the lock, not for the disk
            until_s = time.monotonic() + WRITE_TIMEOUT_S
            retrying(lambda: transaction(database, statements), until_s)

    def _statements(self, items: Sequence[_Item]) -> list[_Statement]:
        found: list[_Statement] = []
        polls: list[Poll] = []
        for item in items:
            if isinstance(item, tuple):
                polls.append(item)
                continue
            found += self._block(polls)
            polls = []
            if isinstance(item, _Begin):
                self._cut, self._kept = item, 0
            elif isinstance(item, _GatheredRows):
                found.append(self._rows(item.part, GATHERED, item.at_utc, item.rows))
            elif (values := item.work()) is not None:
                timed = {MACHINE_S: item.machine_s, **values}
                found.append(event_statement(self._run_id, item.at_utc, item.kind, timed))
        return found + self._block(polls)

    def _end_of_cut(self) -> Mapping[str, object] | None:
        """Return how much there is of the telemetry of the cut; called in the thread."""
        cut, self._cut = self._cut, None
        if cut is None:
            return None
        lost = self._lost + self._dropped
        return {"part": cut.part, "rows": self._kept, "lost": lost, "reason": self._reason}

    def _block(self, polls: list[Poll]) -> list[_Statement]:
        if not polls or self._cut is None:
            return []
        rows = self._cut.make_rows(polls)
        self._kept += len(rows)
        return [self._rows(self._cut.part, POLLED, self._cut.at_utc, rows)] if len(rows) else []

    def _rows(self, part: str, kind: str, at_utc: str, rows: Rows) -> _Statement:
        data = np.ascontiguousarray(rows, dtype="<f4").tobytes()
        return _BLOCK, (self._run_id, part, kind, at_utc, data, self._run_id)


def event_statement(run_id: str, at_utc: str, kind: str, data: Mapping[str, object]) -> _Statement:
    """Return the statement that adds an event to a run."""
    return _EVENT, (run_id, at_utc, kind, event_json(data), run_id)


def event_json(data: Mapping[str, object]) -> str:
    """Return the values of an event as JSON."""
    found = json.dumps(data, ensure_ascii=False)
    # A file name need not be valid text; escaped, it can be stored.
    return found if found.isprintable() else json.dumps(data)
