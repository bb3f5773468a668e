"""Everything of one run: its texts, what was done and seen, each measured part, and the telemetry of its cuts."""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from console.session.data.measured_part import PART_COLUMNS, RecordedPart, column_values
from console.session.data.record_schema import GATHERED_COLUMNS, TELEMETRY_COLUMNS
from console.session.data.run_rows import RunRow, date_of, problem_of, table_of
from profiles.files import parse_toml
from profiles.job import Job, job_from_table
from profiles.problem import Problem
from profiles.strict_values import number_or_none
from profiles.traces import CAP_BYTES

POLLED, GATHERED = "poll", "gather"
"""Kinds of telemetry: status polls of the whole cut, and windows sampled by the controller."""

COMMAND, RAISED, ACKNOWLEDGED, ENDED = "command", "alarm_raised", "alarm_acknowledged", "alarm_ended"
TELEMETRY_END, ACCEPTED = "telemetry", "learned"
"""Kinds of events: how much telemetry was kept of a cut, and an accepted learning step."""

MACHINE_S = "machine_s"
"""Key in the data of an event: machine time since its record was begun, s."""

COLUMNS: Mapping[str, tuple[str, ...]] = {POLLED: TELEMETRY_COLUMNS, GATHERED: GATHERED_COLUMNS}

LEAST_S = 1e-3
LEAST_FEED = 0.8
"""Fraction of the usual feed below which the carriage is coming to rest, and the tool is on its way out."""

MOST_TRACE_BYTES = 5 * CAP_BYTES
"""Of all traces of a run together: a small file may say that it unpacks to any size."""

Kept = TypeVar("Kept")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEvent:
    """An event of a run; `number` is its place in the file, `at` is UTC, `at_s` machine time since its start.

    Where no machine time is recorded (after the end of the run) dates tell `at_s`.
    """

    number: int
    at: datetime
    at_s: float
    kind: str
    data: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmStory:
    """An alarm of a run; when (UTC) it was raised, acknowledged, ended, None: not while the run was open.

    `raised_s` and `acknowledged_s` are machine time, as `RunEvent.at_s`.
    """

    problem: Problem
    priority: str
    raised: datetime
    raised_s: float
    acknowledged: datetime | None = None
    acknowledged_s: float | None = None
    ended: datetime | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedTelemetry:
    """Telemetry of one cut, or a gathered window: M `rows` of `columns`, float32, shape (M, len(columns)).

    `part` names the cut as in `RecordedPart`, `begun` (UTC) is that of its first block.
    """

    part: str
    kind: str
    begun: datetime
    columns: tuple[str, ...]
    rows: NDArray[np.float32] = field(repr=False)

    def column(self, name: str) -> NDArray[np.float32]:
        """Return a column by its name, shape (M,)."""
        return self.rows[:, self.columns.index(name)]

    def fed_along(self, length_mm: float) -> NDArray[np.bool_]:
        """Return which polls, shape (M,), are of the tool fed along the part; before and after it is far away."""
        z_mm, time_s = (self.column(name).astype(np.float64) for name in ("z_mm", "time_s"))
        over = (z_mm >= 0.0) & (z_mm <= length_mm)
        if not over.any():
            return over
        feed_mm_per_s = np.append(np.diff(z_mm) / np.maximum(np.diff(time_s), LEAST_S), 0.0)
        return np.asarray(over & (feed_mm_per_s > LEAST_FEED * np.median(feed_mm_per_s[over])))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunStory:
    """Everything that is recorded of one run; what was not recorded is None or empty.

    `job_text` and `machine_text` are TOML. `setup` has the forces and the alignment of the cut. `complete` is
    whether all telemetry of the cuts was kept; None where there was none to keep. `damaged` names what cannot be
    read.
    """

    row: RunRow
    software: str
    python: str | None
    controller: str | None
    family: str | None
    job_sha256: str
    job_text: str | None = field(repr=False)
    machine_sha256: str
    machine_text: str | None = field(repr=False)
    program: str = field(repr=False)
    setup: Mapping[str, Any]
    events: tuple[RunEvent, ...] = field(repr=False)
    parts: tuple[RecordedPart, ...]
    telemetry: tuple[RecordedTelemetry, ...]
    damaged: tuple[str, ...] = ()

    @property
    def product(self) -> RecordedPart | None:
        """The last measured part that the run was for; None where it was not measured."""
        return next((part for part in reversed(self.parts) if part.product), None)

    def read_job(self) -> Job | None:
        """Parse the job as it was cut; None where its text was not kept. ProfileError: it cannot be read."""
        kept = self.job_text
        return None if kept is None else job_from_table(parse_toml(kept.encode("utf-8", "replace"), ""))

    @property
    def cut_verdict(self) -> Mapping[str, Any]:
        """The verdict on the last cut, with the figures of its tool; empty where none is recorded."""
        events = (event.data for event in reversed(self.events) if "cut_verdict" in event.data)
        return next(events, {})

    @property
    def commands(self) -> tuple[RunEvent, ...]:
        """The operator's actions during the run."""
        return self._of_kind(COMMAND)

    @property
    def accepted_steps(self) -> tuple[RunEvent, ...]:
        """The learning steps that were accepted from its part."""
        return self._of_kind(ACCEPTED)

    @property
    def alarms(self) -> tuple[AlarmStory, ...]:
        """The alarms that stood during the run, in the order in which they were raised."""
        return alarm_stories(self.events)

    @property
    def complete(self) -> bool | None:
        """Whether all telemetry of the cuts was kept."""
        ends = self._of_kind(TELEMETRY_END)
        polled = sum(len(each.rows) for each in self.telemetry if each.kind == POLLED)
        if not ends:
            begun = self.python is not None and any(map(_begins_cut, self.events))
            return False if polled or begun else None
        return polled == sum(end.data.get("rows", -1) for end in ends) and not any(
            end.data.get("lost") for end in ends
        )

    def _of_kind(self, kind: str) -> tuple[RunEvent, ...]:
        return tuple(event for event in self.events if event.kind == kind)


def _begins_cut(event: RunEvent) -> bool:
    return event.kind == "started" or (event.kind == "step" and event.data.get("step") == "cut")


def alarm_stories(events: Iterable[RunEvent]) -> tuple[AlarmStory, ...]:
    """Return the alarms in some events; each raise begins one, what follows of the same code and key is of it."""
    found: list[AlarmStory] = []
    for event in events:
        if event.kind not in (RAISED, ACKNOWLEDGED, ENDED):
            continue
        problem = problem_of(event.data)
        if event.kind == RAISED:
            priority = str(event.data.get("priority", ""))
            found.append(AlarmStory(problem=problem, priority=priority, raised=event.at, raised_s=event.at_s))
            continue
        for place in reversed(range(len(found))):
            alarm = found[place]
            if (alarm.problem.code, alarm.problem.key) != (problem.code, problem.key):
                continue
            if event.kind == ACKNOWLEDGED and alarm.acknowledged is None:
                found[place] = replace(alarm, acknowledged=event.at, acknowledged_s=event.at_s)
            elif event.kind == ENDED:
                found[place] = replace(alarm, ended=alarm.ended or event.at)
            break
    return tuple(found)


_RUN = """SELECT software, python, controller, family, job_sha256, job_text_sha256, machine_sha256,
    machine_text_sha256, program, setup FROM runs WHERE run_id = ?"""
_TEXT = "SELECT content FROM texts WHERE sha256 = ?"
_EVENTS = "SELECT number, at_utc, kind, data FROM events WHERE run_id = ? ORDER BY number"
_PARTS = f"""SELECT number, at_utc, data, trace_sha256, {", ".join(PART_COLUMNS)}
    FROM measurements WHERE run_id = ? ORDER BY number"""
_TRACE = "SELECT content FROM traces WHERE run_id = ? AND number = ?"
_TELEMETRY = "SELECT part, kind, begun_utc, data FROM telemetry WHERE run_id = ? ORDER BY number"


def story_of(database: sqlite3.Connection, row: RunRow) -> RunStory:
    """Return everything of a run; what is damaged is left out, and named in `damaged`. sqlite3.Error."""
    damaged: list[str] = []

    def kept(what: str, read: Callable[[], Kept]) -> Kept | None:
        try:
            return read()
        except (sqlite3.DatabaseError, ValueError, TypeError, KeyError, zlib.error):
            damaged.append(what)
            return None

    run_id = row.run_id
    run = database.execute(_RUN, (run_id,)).fetchone()
    software, python, controller, family, job_sha256, job, machine_sha256, machine, program, setup = run
    events = kept("events", lambda: _events(database.execute(_EVENTS, (run_id,)), row.started))
    parts = kept("measurements", lambda: tuple(map(_part, database.execute(_PARTS, (run_id,)))))
    traced, room = list[RecordedPart](), MOST_TRACE_BYTES
    for part in parts or ():
        trace = kept(f"trace {part.number}", partial(_trace, database, run_id, part.number, min(room, CAP_BYTES)))
        traced.append(replace(part, trace=trace))
        room -= len(trace or b"")
    telemetry = kept("telemetry", lambda: _telemetry(database.execute(_TELEMETRY, (run_id,))))
    return RunStory(
        row=row,
        software=software,
        python=python,
        controller=controller or _controller(events or ()),
        family=family,
        job_sha256=job_sha256,
        job_text=kept("job", partial(_text, database, job)),
        machine_sha256=machine_sha256,
        machine_text=kept("machine", partial(_text, database, machine)),
        program=program,
        setup={} if setup is None else table_of(setup),
        events=events or (),
        parts=tuple(traced),
        telemetry=telemetry or (),
        damaged=tuple(damaged),
    )


def _events(found: Iterable[Sequence[Any]], started: datetime) -> tuple[RunEvent, ...]:
    """Return events in the order of time: those of the log are written some moments later than the others."""
    events, before, before_s = [], started, 0.0
    dated = ((*date_of(at), number, kind, table_of(data)) for number, at, kind, data in found)
    for at, undated, number, kind, data in sorted(dated, key=lambda each: each[0]):
        since_s = 0.0 if undated else (at - before).total_seconds()
        machine_s = number_or_none(data.pop(MACHINE_S, None))
        at_s = before_s + since_s if machine_s is None else machine_s
        events.append(RunEvent(number=number, at=at, at_s=at_s, kind=kind, data=data))
        before, before_s = (before if undated else at), at_s
    return tuple(events)


def _controller(events: Iterable[RunEvent]) -> str | None:
    """Return the controller as it answered a run without a screen, which begins before it is asked."""
    loads = (event.data for event in events if event.kind == "step" and event.data.get("step") == "load")
    return next((str(data["detail"]) for data in loads if data.get("detail")), None)


def _part(found: Sequence[Any]) -> RecordedPart:
    number, at, data, sha256, *columns = found
    known = {"number": number, "at": date_of(at)[0], "data": table_of(data), "trace_sha256": sha256}
    return RecordedPart(**known, **column_values(columns))


def _text(database: sqlite3.Connection, sha256: str | None) -> str | None:
    found = None if sha256 is None else database.execute(_TEXT, (sha256,)).fetchone()
    return None if found is None else str(found[0])


def _trace(database: sqlite3.Connection, run_id: str, number: int, most_bytes: int) -> bytes | None:
    found = database.execute(_TRACE, (run_id, number)).fetchone()
    return None if found is None else _unpack_trace(found[0], most_bytes)


def _unpack_trace(content: bytes, most_bytes: int) -> bytes:
    """Return a trace as its file had it. Raises zlib.error; ValueError: it is cut short, or has more bytes."""
    unpacker = zlib.decompressobj()
    found = unpacker.decompress(content, most_bytes + 1)
    if len(found) > most_bytes or not unpacker.eof:
        raise ValueError(f"not a trace of at most {most_bytes} bytes")
    return found


def _telemetry(found: Iterable[Sequence[Any]]) -> tuple[RecordedTelemetry, ...]:
    """Join the blocks of each cut; ValueError of a block that is no whole number of rows."""
    blocks: dict[tuple[str, str], tuple[str, list[NDArray[np.float32]]]] = {}
    for part, kind, begun, data in found:
        rows = np.frombuffer(data, dtype="<f4").reshape(-1, len(COLUMNS[kind]))
        blocks.setdefault((part, kind), (begun, []))[1].append(rows)
    return tuple(
        RecordedTelemetry(
            part=part, kind=kind, begun=date_of(begun)[0], columns=COLUMNS[kind], rows=np.concatenate(rows)
        )
        for (part, kind), (begun, rows) in blocks.items()
    )
