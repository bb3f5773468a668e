"""Alarms as values: raised, seen, acknowledged, cleared. The first one stays in front of its own flood."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

from profiles.problem import Problem


class Priority(IntEnum):
    """How soon somebody must act; the lowest number first."""

    HIGH = 0
    MEDIUM = 1
    LOW = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One condition that wants a response. `at_s` is machine time of its first raise, `count` its raises."""

    problem: Problem
    priority: Priority
    at_s: float
    count: int = 1
    acknowledged: bool = False
    active: bool = True


Alarms = tuple[Alarm, ...]


def raised(alarms: Alarms, problem: Problem, priority: Priority, at_s: float) -> Alarms:
    """Return the alarms with one more, or with the one of the same code counted again and wanting attention."""
    for place, alarm in enumerate(alarms):
        if alarm.problem.code == problem.code and alarm.problem.key == problem.key:
            again = replace(alarm, problem=problem, count=alarm.count + 1, acknowledged=False, active=True)
            return (*alarms[:place], again, *alarms[place + 1 :])
    return (*alarms, Alarm(problem=problem, priority=priority, at_s=at_s))


def acknowledged(alarms: Alarms) -> Alarms:
    """Return the alarms as seen by the operator; those whose cause is gone leave. Nothing is reset by it."""
    return tuple(replace(alarm, acknowledged=True) for alarm in alarms if alarm.active)


def cleared(alarms: Alarms, *codes: str) -> Alarms:
    """Return the alarms after the cause of these codes is gone: what was seen leaves, what was not stays."""
    after = (replace(a, active=False) if a.problem.code in codes else a for a in alarms)
    return tuple(alarm for alarm in after if alarm.active or not alarm.acknowledged)


def foremost(alarms: Alarms) -> Alarm | None:
    """Return the one to show: not yet seen before seen, by priority, the first that came."""
    return min(alarms, key=lambda a: (a.acknowledged, a.priority, a.at_s), default=None)
