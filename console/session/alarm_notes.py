"""Alarms of the screens and their ends in the log of the program, written in a thread of its own.

The screens only hand over what has happened: a full disk or a slow one delays neither them nor a stop.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Sequence
from pathlib import Path
from queue import SimpleQueue

from console.session.program_log import note
from console.session.station.history.session_log import LogEntry, LogKind

NOTED = (LogKind.RAISED, LogKind.ENDED)
CLOSE_S = 1.0


class AlarmNotes:
    """Called with entries of the log of the session; those of alarms go into the log of the program."""

    def __init__(self, data: Path, machine: str, *, simulated: bool) -> None:
        self._data, self._of = data, f"SIM {machine}" if simulated else machine
        self._waiting: SimpleQueue[LogEntry | None] = SimpleQueue()
        self._thread: threading.Thread | None = None

    def __call__(self, entries: Sequence[LogEntry]) -> None:
        """Take entries; returns at once."""
        for entry in entries:
            if entry.kind in NOTED:
                self._waiting.put(entry)
                self._start()

    def close(self) -> None:
        """Wait for what is still to be written, but not long."""
        if self._thread is not None:
            self._waiting.put(None)
            self._thread.join(CLOSE_S)

    def _start(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._write, name="alarm notes", daemon=True)
            self._thread.start()

    def _write(self) -> None:
        while (entry := self._waiting.get()) is not None:
            level = logging.WARNING if entry.kind is LogKind.RAISED else logging.INFO
            note(self._data, alarm_note(entry, self._of), level=level)


def alarm_note(entry: LogEntry, machine: str) -> str:
    """Return the line of an alarm: what happened to which number, the sentence in English, and its facts."""
    problem = entry.problem
    words = "" if problem is None else f"  {problem}  [{problem.facts}]"
    return f"alarm {entry.number} {entry.kind.value}  {machine}{words}"
