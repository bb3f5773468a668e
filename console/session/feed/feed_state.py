"""A state of the feed: its values, described in docs/feed.md, and the limits within which they are read. Pure.

A line may come from a broken console, or from another program: `read_state` alone makes a state of it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

from console.session.cut.cut_verdict import CutJudgement
from console.session.feed.observed_state import RUN, SCREENS
from console.session.feed.request import SCHEMA
from console.session.station.state import Activity
from profiles.files import printable
from profiles.problem import Problem
from profiles.strict_values import from_json, record


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedAlarm:
    """An alarm; `number` is that of the page Alarms."""

    number: int | None
    code: str
    priority: str
    state: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedOwner:
    """The console that controls the machine, as far as it is known."""

    number: int | None
    name: str | None
    host: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedAxes:
    """Positions; None before homing."""

    tool_radius_mm: float | None
    carriage_mm: float | None
    spindle_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedCut:
    """How far a cut is."""

    stage: str
    turn: float | None
    turns: float | None
    left_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedStep:
    """The next step, with what its sentence names; `why` its key does nothing now, or no cut can start yet."""

    word: str
    key: str | None
    left_s: float | None
    force_n: float | None
    radius_mm: float | None
    why: tuple[Problem, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedState:
    """One moment of a console, in the order of its line."""

    schema: int
    at_utc: str
    process: int
    program: str
    simulated: bool
    machine: str
    job: str | None
    activity: str
    execution: str
    mode: str
    controls: bool
    controlled_by: FeedOwner | None
    age_s: float | None
    stale: bool
    spindle_rpm: float | None
    axes: FeedAxes
    cut: FeedCut | None
    tool_error_um: float | None
    parts: int
    run_id: str | None
    alarms: tuple[FeedAlarm, ...]
    cut_verdict: str | None = None
    next: FeedStep | None = None


def rank(state: FeedState) -> tuple[bool, bool, bool, str]:
    """Return by what the console to believe is chosen among those on one machine: the largest."""
    return state.controls, state.execution != "unavailable", not state.stale, state.at_utc


EXECUTIONS, MODES = ("unavailable", "ready", "active", "feed_hold", "stopped"), ("automatic", "manual")
PRIORITIES, ALARM_STATES = ("high", "medium", "low"), ("new", "acknowledged", "returned")

_PARTS = {
    "alarms": FeedAlarm,
    "axes": FeedAxes,
    "controlled_by": FeedOwner,
    "cut": FeedCut,
    "next": FeedStep,
    "why": Problem,
}
_WORDS: Mapping[str, Collection[str]] = {
    "program": (SCREENS, RUN),
    "activity": tuple(Activity),
    "execution": EXECUTIONS,
    "mode": MODES,
    "cut_verdict": tuple(CutJudgement),
    "stage": ("position", "run_up", "cut", "paused", "retract", "done", "held"),
    "priority": PRIORITIES,
    "state": ALARM_STATES,
}
_LIMITS = {
    "schema": (SCHEMA, SCHEMA),
    "process": (1, 2**31 - 1),
    "number": (-1e15, 1e15),  # of a console: whatever another host has written there
    "parts": (0, 1e9),
    "spindle_deg": (0.0, 360.0),
}
_OTHER_LIMITS = (-1e12, 1e12)  # mm, um, rpm, s, turns: no lathe has more
LONGEST_TEXT, _MOST_ALARMS = 4000, 1000
_AT_UTC = re.compile(r"[12]\d{3}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,6})?Z", re.ASCII)


def read_state(line: bytes) -> FeedState:
    """Return the state in a line, its texts printable, on one line. Values that are not in the schema are ignored.

    Raises ValueError, TypeError if it is none: which value, what it is, what is allowed.
    """
    table = from_json(line)
    if not isinstance(table, dict):
        raise TypeError("no object")
    if "refused" in table:
        raise ValueError(table["refused"])
    state = record(FeedState, _part(FeedState, table))
    if not _AT_UTC.fullmatch(state.at_utc):
        raise ValueError(f"at_utc {state.at_utc}, allowed YYYY-MM-DDThh:mm:ssZ")
    datetime.fromisoformat(state.at_utc)
    return state


def _part(kind: type, table: Mapping[str, Any]) -> dict[str, Any]:
    return {each.name: _value(each.name, table[each.name]) for each in fields(kind) if each.name in table}


def _value(name: str, value: Any) -> Any:
    """Return a plain value that keeps the limits of its name; `record` checks its type."""
    (low, high), words = _LIMITS.get(name, _OTHER_LIMITS), _WORDS.get(name)
    match value:
        case dict() if name in _PARTS:
            return _part(_PARTS[name], value)
        case list():
            allowed = f"{_MOST_ALARMS} entries"
            if len(value) <= _MOST_ALARMS:
                return [_value(name, each) for each in value]
        case str():
            allowed = f"{LONGEST_TEXT} characters" if words is None else ", ".join(words)
            if len(value) <= LONGEST_TEXT if words is None else value in words:
                return printable(value, LONGEST_TEXT)
        case _:
            allowed = f"{low:.10g} to {high:.10g}"
            if value is None or (isinstance(value, bool | int | float) and low <= value <= high):
                return value
    raise ValueError(f"{name} {value!r}, allowed {allowed}")
