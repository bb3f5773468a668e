"""What the operator did and which alarms stood, as events of the run record."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, fields
from enum import Enum
from pathlib import Path

from console.session.data.run_story import ACKNOWLEDGED, ENDED, RAISED
from console.session.operator import operator_name
from console.session.station.alarms import Alarm, Alarms
from console.session.station.commands import Acknowledge, Command
from profiles.files import printable

CONSOLE = "console"
OWN_REASONS = ("screen", "fault", "end")
"""Reasons of stops that the console sends by itself, besides the codes of problems."""

Event = tuple[str, dict[str, object]]


def command_event(command: Command) -> dict[str, object]:
    """Return a command with those of its fields that are plain values; a job or a plan is recorded elsewhere."""
    found: dict[str, object] = {"command": type(command).__name__, "by": operator_name()}
    for each in fields(command):
        value = getattr(command, each.name)
        if isinstance(value, Enum):
            found[each.name] = value.value
        elif isinstance(value, str | int | float):
            found[each.name] = value
        elif isinstance(value, Path):
            found[each.name] = printable(value.name)
    if isinstance(command, Acknowledge):
        found["shown"] = [problem.code for problem in command.shown]
    return found


def stopped_by(reason: str) -> str:
    """Return who stopped the machine: the operator, by a key; the console itself, by a code; or a signal."""
    if "." in reason or reason in OWN_REASONS:
        return CONSOLE
    return reason if reason.startswith("SIG") and reason != "SIGINT" else operator_name()


def alarm_events(before: Alarms, after: Alarms) -> Iterator[Event]:
    """Yield what has changed: alarms raised (again), acknowledged, ended."""
    known = {_alarm_key(alarm): alarm for alarm in before}
    now = {_alarm_key(alarm): alarm for alarm in after}
    for which, alarm in now.items():
        old = known.get(which)
        if old is None or alarm.count > old.count:
            yield RAISED, _event(alarm)
        if alarm.acknowledged and (old is None or not old.acknowledged):
            yield ACKNOWLEDGED, {**_event(alarm), "by": operator_name()}
        if not alarm.active and (old is None or old.active):
            yield ENDED, _event(alarm)
    for which, old in known.items():
        if which not in now:
            if not old.active:  # it has ended before, and leaves now that it is acknowledged
                yield ACKNOWLEDGED, {**_event(old), "by": operator_name()}
            else:
                yield ENDED, _event(old)


def _alarm_key(alarm: Alarm) -> tuple[str, str]:
    return alarm.problem.code, alarm.problem.key


def _event(alarm: Alarm) -> dict[str, object]:
    return {**asdict(alarm.problem), "priority": alarm.priority.name.lower(), "count": alarm.count}
