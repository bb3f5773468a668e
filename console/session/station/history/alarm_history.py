"""The alarms of a session: a number and times for each, the first of a group, those that are over, and their rate.

It follows the alarms of the states. None is missed between two of them: an alarm that was raised stays until it is
acknowledged.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from enum import StrEnum

from console.session.station.alarms import Alarm, Alarms
from profiles.problem import Problem

FIRST_OUT_S = 3.0
"""An alarm within this time of the one before belongs to its group: most often a consequence of the first."""

PAST_MOST, RAISES_MOST = 200, 1000
"""So many alarms that are over, and so many raises, are kept: the newest."""

HOUR_S, FLOOD_S, FLOOD = 3600.0, 600.0, 10
"""More than `FLOOD` raises within `FLOOD_S` are an alarm flood (ISA-18.2)."""

_LONGEST_S = 1e8  # an alarm that claims to be older has no time of day
Which = tuple[str, str]


class AlarmState(StrEnum):
    """States of an alarm, in words of ISA-18.2: `RETURNED` to normal, unacknowledged; `PAST` is gone."""

    NEW = "new"
    ACKNOWLEDGED = "acknowledged"
    RETURNED = "returned"
    PAST = "past"


@dataclass(frozen=True, slots=True, kw_only=True)
class Instant:
    """One time by both clocks: of the machine, s, and local."""

    now_s: float
    clock: datetime

    def local_time_at(self, past_s: float) -> datetime:
        """Return the local time of a machine time."""
        age_s = self.now_s - past_s
        return self.clock - timedelta(seconds=age_s) if abs(age_s) < _LONGEST_S else self.clock


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmEntry:
    """One alarm from its first raise until it is gone. `group` is the number of the first alarm of its group.

    `again` is its last raise, where it was raised `count` > 1 times. Times are local; None: not yet.
    """

    number: int
    group: int
    alarm: Alarm
    raised: datetime
    again: datetime | None = None
    acknowledged: datetime | None = None
    ended: datetime | None = None
    is_past: bool = False

    @property
    def problem(self) -> Problem:
        """What it reports."""
        return self.alarm.problem

    @property
    def state(self) -> AlarmState:
        """Its state now."""
        if self.is_past:
            return AlarmState.PAST
        if not self.alarm.active:
            return AlarmState.RETURNED
        return AlarmState.ACKNOWLEDGED if self.alarm.acknowledged else AlarmState.NEW


class AlarmChange(StrEnum):
    """What happened to an alarm."""

    RAISED = "raised"
    ACKNOWLEDGED = "acknowledged"
    ENDED = "ended"


Changes = tuple[tuple[AlarmChange, AlarmEntry], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmHistory:
    """The alarms that stand, in the order of the state; those over, newest last; the raises (machine s)."""

    alarms: Alarms = ()
    standing: tuple[AlarmEntry, ...] = ()
    past: tuple[AlarmEntry, ...] = ()
    raises: tuple[tuple[float, Problem], ...] = field(default=(), repr=False)
    count: int = 0
    group: int = 0

    @property
    def list_entries(self) -> tuple[AlarmEntry, ...]:
        """Those that stand, the foremost first, then those that are over, newest first."""
        front = sorted(self.standing, key=lambda e: (e.alarm.acknowledged, e.alarm.priority, e.alarm.at_s))
        return (*front, *reversed(self.past))

    def group_of(self, entry: AlarmEntry) -> int:
        """Return how many known alarms are in the group of one."""
        return sum(each.group == entry.group for each in (*self.standing, *self.past))

    def rate(self, now_s: float, span_s: float) -> int:
        """Return how many raises were within the last `span_s`; `RAISES_MOST` may be more."""
        return sum(now_s - at_s <= span_s for at_s, _ in self.raises)

    def is_flood(self, now_s: float) -> bool:
        """Whether more alarms come than an operator can respond to."""
        return self.rate(now_s, FLOOD_S) > FLOOD

    def most_frequent(self, count: int) -> tuple[tuple[Problem, int], ...]:
        """Return the alarms that were raised most often, and how often; each as it was raised last."""
        newest = {(problem.code, problem.key): problem for _, problem in self.raises}
        often = Counter((problem.code, problem.key) for _, problem in self.raises)
        return tuple((newest[which], times) for which, times in often.most_common(count))


def follow_alarms(history: AlarmHistory, alarms: Alarms, now: Instant) -> tuple[AlarmHistory, Changes]:
    """Return the history with the alarms as they are now, and what has happened to which."""
    if alarms is history.alarms:
        return history, ()
    known = {_alarm_key(entry.alarm): entry for entry in history.standing}
    changes: list[tuple[AlarmChange, AlarmEntry]] = []
    after: dict[Which, AlarmEntry] = {}
    for alarm in sorted(alarms, key=lambda each: each.at_s):
        old = known.get(_alarm_key(alarm))
        if old is not None and old.alarm.at_s == alarm.at_s:
            history, entry = _continue_entry(history, known.pop(_alarm_key(alarm)), alarm, now)
        else:  # one of the same kind that left and came again in between is another one
            history, entry = _begin_entry(history, alarm, now)
        after[_alarm_key(alarm)] = entry
        changes += _changes(old if old is not None and old.number == entry.number else None, entry)
    gone = [_end_entry(entry, now) for entry in known.values()]
    for entry in gone:
        changes += _changes(known[_alarm_key(entry.alarm)], entry)
    standing = tuple(after[_alarm_key(alarm)] for alarm in alarms)
    past = (*history.past, *gone)[-PAST_MOST:]
    return replace(history, alarms=alarms, standing=standing, past=past), tuple(changes)


def _begin_entry(history: AlarmHistory, alarm: Alarm, now: Instant) -> tuple[AlarmHistory, AlarmEntry]:
    number = history.count + 1
    history = replace(_with_raise(history, alarm, alarm.at_s, number), count=number)
    entry = AlarmEntry(
        number=number,
        group=history.group,
        alarm=alarm,
        raised=now.local_time_at(alarm.at_s),
        again=now.clock if alarm.count > 1 else None,
        acknowledged=now.clock if alarm.acknowledged else None,
        ended=None if alarm.active else now.clock,
    )
    return history, entry


def _continue_entry(
    history: AlarmHistory, old: AlarmEntry, alarm: Alarm, now: Instant
) -> tuple[AlarmHistory, AlarmEntry]:
    entry = replace(old, alarm=alarm)
    if alarm.count > old.alarm.count:
        history = _with_raise(history, alarm, now.now_s, old.number)
        entry = replace(entry, group=history.group, again=now.clock, acknowledged=None, ended=None)
    if alarm.acknowledged and entry.acknowledged is None:
        entry = replace(entry, acknowledged=now.clock)
    if not alarm.active and entry.ended is None:
        entry = replace(entry, ended=now.clock)
    return history, entry


def _end_entry(entry: AlarmEntry, now: Instant) -> AlarmEntry:
    """Return an alarm that has left: it has ended and was acknowledged, whichever was the last."""
    return replace(
        entry, acknowledged=entry.acknowledged or now.clock, ended=entry.ended or now.clock, is_past=True
    )


def _with_raise(history: AlarmHistory, alarm: Alarm, at_s: float, number: int) -> AlarmHistory:
    follows = bool(history.raises) and abs(at_s - history.raises[-1][0]) <= FIRST_OUT_S
    raises = (*history.raises, (at_s, alarm.problem))[-RAISES_MOST:]
    return replace(history, raises=raises, group=history.group if follows else number)


def _changes(old: AlarmEntry | None, entry: AlarmEntry) -> Changes:
    found: list[tuple[AlarmChange, AlarmEntry]] = []
    if old is None or entry.alarm.count > old.alarm.count:
        found.append((AlarmChange.RAISED, entry))
    if entry.ended is not None and (old is None or old.ended is None):
        found.append((AlarmChange.ENDED, entry))
    if entry.acknowledged is not None and (old is None or old.acknowledged is None):
        found.append((AlarmChange.ACKNOWLEDGED, entry))
    return tuple(found)


def _alarm_key(alarm: Alarm) -> Which:
    return alarm.problem.code, alarm.problem.key
