"""The log of a session: every command of the operator and every message, with its time; in memory, and bounded.

What was typed into a field of free text is in none of its entries, unless it is the name of a file by now.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import StrEnum
from typing import TYPE_CHECKING

from console.session.station.history.alarm_history import AlarmChange, AlarmHistory, Instant, follow_alarms
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.session.station.alarms import Alarms
    from console.session.station.state import StationState, StopState

LOG_MOST = 500
"""So many entries are kept: the newest."""

TYPED = "…"
"""In the place of a fact that may repeat what was typed."""

STORED = frozenset(f"screen.{what}" for what in ("job_renamed", "job_imported", "job_exported", "calibrate_kept"))
"""Answers to what was typed that name what is stored by now, in files that say so themselves."""


class LogKind(StrEnum):
    """Kinds of entries."""

    COMMAND = "command"
    REFUSED = "refused"
    RAISED = "raised"
    ACKNOWLEDGED = "acknowledged"
    ENDED = "ended"
    STOPPED = "stopped"
    REST = "rest"
    MESSAGE = "message"
    INSTRUCTOR = "instructor"


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEntry:
    """One entry: the name of a command, a reason or an order, a problem, the number of an alarm; `times` in a row.

    `axis` and `distance` (mm or degrees, signed) are those of a jog. `at` is local time, of the first.
    """

    at: datetime
    kind: LogKind
    word: str = ""
    problem: Problem | None = None
    number: int = 0
    axis: str = ""
    distance: float = 0.0
    times: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionLog:
    """Alarms and entries, newest last, up to a moment; `dropped` older entries are no longer kept.

    `said`, `refusals` and `stop` are what was shown last, to find what is new.
    """

    alarms: AlarmHistory = field(default_factory=AlarmHistory)
    entries: tuple[LogEntry, ...] = ()
    dropped: int = 0
    said: tuple[Problem, ...] = ()
    refusals: tuple[Problem, ...] = ()
    stop: StopState | None = None

    @property
    def count(self) -> int:
        """All entries so far, those that are no longer kept included."""
        return len(self.entries) + self.dropped

    def with_entries(self, *fresh: LogEntry) -> SessionLog:
        """Return the log with more entries; an entry that repeats the last one only raises its count."""
        entries = self.entries
        for entry in fresh:
            last = entries[-1] if entries else None
            if last is not None and replace(last, at=entry.at, times=1) == entry:
                entries = (*entries[:-1], replace(last, times=last.times + 1))
            else:
                entries = (*entries, entry)
        kept = entries[-LOG_MOST:]
        return replace(self, entries=kept, dropped=self.dropped + len(entries) - len(kept))


def command_entry(name: str, *, taken: bool, at: datetime, axis: str = "", distance: float = 0.0) -> LogEntry:
    """Return the entry of a command of the operator; `taken` is False if the machine was busy."""
    kind = LogKind.COMMAND if taken else LogKind.REFUSED
    return LogEntry(at=at, kind=kind, word=name, axis=axis, distance=distance)


def with_state(
    log: SessionLog, state: StationState, said: tuple[Problem, ...], now: Instant, *, typed: bool = False
) -> SessionLog:
    """Return the log with what a state shows that was not there before.

    `said` is the answer of the screen to the last key; after a key of a field of free text (`typed`) its facts may
    be what was typed.
    """
    log = _with_alarms(log, state.alarms, now)
    log = _with_stop(log, state.stop, now)
    fresh = [] if said is log.said else [_hide_typed_values(each) if typed else each for each in said]
    fresh += [] if state.refusals is log.refusals else state.refusals
    entries = [LogEntry(at=now.clock, kind=LogKind.MESSAGE, problem=problem) for problem in fresh]
    if not entries and said is log.said and state.refusals is log.refusals:
        return log
    return replace(log.with_entries(*entries), said=said, refusals=state.refusals)


def _with_alarms(log: SessionLog, alarms: Alarms, now: Instant) -> SessionLog:
    if alarms is log.alarms.alarms:
        return log
    history, changes = follow_alarms(log.alarms, alarms, now)
    entries = [
        LogEntry(
            at=(entry.again or entry.raised) if change is AlarmChange.RAISED else now.clock,
            kind=LogKind(change.value),
            problem=entry.problem,
            number=entry.number,
        )
        for change, entry in changes
    ]
    return replace(log.with_entries(*entries), alarms=history)


def _with_stop(log: SessionLog, stop: StopState | None, now: Instant) -> SessionLog:
    before = log.stop
    if stop is before:
        return log
    log = replace(log, stop=stop)
    if stop is None:
        return log
    if before is None or before.sent_s != stop.sent_s:
        log = log.with_entries(LogEntry(at=now.local_time_at(stop.sent_s), kind=LogKind.STOPPED, word=stop.reason))
        before = None
    if stop.rest_s is not None and (before is None or before.rest_s is None):
        seconds = f"{stop.rest_s - stop.sent_s:.1f}"
        log = log.with_entries(LogEntry(at=now.local_time_at(stop.rest_s), kind=LogKind.REST, word=seconds))
    return log


def _hide_typed_values(problem: Problem) -> Problem:
    if problem.code in STORED:
        return problem
    return replace(problem, value=problem.value and TYPED, limit=problem.limit and TYPED, where="")
