"""Alarms as values: raised, seen, acknowledged, cleared. The first stays on top of the flood that follows it.

An alarm reports a condition or an event. A condition is monitored: it stands as long as its cause, across a stop
and the reset after it (F2), and stays acknowledged once it was. An event ends with that reset, or with its cut.
What has ended leaves once it was seen; what was not seen stays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import IntEnum

from drivers.simulator.plant.workshop_view import CollisionKind
from profiles.problem import Problem

_CODES = {
    CollisionKind.STANDING_PART: "simulator.met_standing_part",
    CollisionKind.END_FACE: "simulator.met_end_face",
    CollisionKind.TOO_DEEP: "simulator.met_too_deep",
    CollisionKind.THROUGH_WALL: "simulator.met_through_wall",
    CollisionKind.JAWS: "simulator.met_jaws",
    CollisionKind.INFEED: "simulator.met_infeed",
    CollisionKind.REVERSE: "simulator.met_reverse",
    CollisionKind.END_OF_TRAVEL: "simulator.met_end_of_travel",
}

COLLISION_CODES = tuple(_CODES.values())

FAULT = "machine.fault"  # axis faults reported by the controller; `value` names them, separated by commas
AT_REST = "rest"  # the `key` of faults that stopped nothing, because nothing was under control
IN_PROGRAM = "program"  # that of faults in a cut
OUSTED = "owner.ousted"
NOBODYS = ("owner.restarted", "owner.let_go")
"""This console has lost control, and nobody has it: by a restart of the controller, or after another console."""
HOME_LOST = ("controller.was_reset", "controller.home_lost", "controller.zero_shifted")
"""Lost positions: active until every axis is homed again."""

OPENED = "machine.opened_unasked"  # one drive is off that was on; active until all are on or off

CONDITIONS = frozenset(
    {
        FAULT,
        "safety.not_good",
        "stops.connection_lost",
        "owner.held",
        "owner.beside",
        OUSTED,
        *NOBODYS,
        "owner.free",
        "heartbeat.lost",
        "trial.active",
        "trial.stands",
        "trial.unknown",
        "trial.file",
        *HOME_LOST,
        OPENED,
        *COLLISION_CODES,
    }
)
"""Monitored conditions: whoever raises one clears it when its cause is gone."""

OF_A_CUT = (
    "cut.out_of_phase",
    "cut.tool_leads",
    "cut.spindle_stands",
)  # alarms that end with the cut they belong to


class Priority(IntEnum):
    """Priority of the operator's response; the lowest number first."""

    HIGH = 0
    MEDIUM = 1
    LOW = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One condition or event that needs a response.

    `at_s` is machine time of its first raise, `count` its raises. `active` is False once its cause is gone.
    """

    problem: Problem
    priority: Priority
    at_s: float
    count: int = 1
    acknowledged: bool = False
    active: bool = True

    @property
    def faults(self) -> tuple[str, ...]:
        """The axis faults that it reports."""
        named = self.problem.value if self.problem.code == FAULT else ""
        return tuple(named.split(", ")) if named else ()


Alarms = tuple[Alarm, ...]


def collision_problems(kinds: Iterable[str]) -> tuple[Problem, ...]:
    """Return a problem for each kind of collision seen at the chuck."""
    return tuple(Problem(code=_CODES[CollisionKind(kind)]) for kind in kinds)


def raise_alarm(alarms: Alarms, problem: Problem, priority: Priority, at_s: float) -> Alarms:
    """Return the alarms with one more; one of the same code is counted again and becomes unseen."""
    for place, alarm in enumerate(alarms):
        if alarm.problem.code == problem.code and alarm.problem.key == problem.key:
            again = replace(alarm, problem=problem, count=alarm.count + 1, acknowledged=False, active=True)
            return (*alarms[:place], again, *alarms[place + 1 :])
    return (*alarms, Alarm(problem=problem, priority=priority, at_s=at_s))


def restate_alarm(alarms: Alarms, problem: Problem) -> Alarms:
    """Return the alarms with the problem of an active one updated; it is neither raised nor unseen again."""
    return tuple(
        replace(alarm, problem=problem)
        if alarm.active and (alarm.problem.code, alarm.problem.key) == (problem.code, problem.key)
        else alarm
        for alarm in alarms
    )


def acknowledge_alarms(alarms: Alarms) -> Alarms:
    """Return the alarms as seen by the operator; those whose cause is gone leave. Nothing is reset."""
    return tuple(replace(alarm, acknowledged=True) for alarm in alarms if alarm.active)


def acknowledge_shown_alarms(alarms: Alarms, shown: tuple[Problem, ...] = ()) -> Alarms:
    """Return the alarms with the `shown` ones acknowledged, else the foremost; the others wait."""
    front = foremost(alarms)
    which = shown or (() if front is None else (front.problem,))
    return tuple(
        after
        for alarm in alarms
        for after in (acknowledge_alarms((alarm,)) if alarm.problem in which else (alarm,))
    )


def clear_alarms(alarms: Alarms, *codes: str) -> Alarms:
    """Return the alarms after the cause of these codes is gone: seen ones leave, unseen ones stay."""
    return _end_alarms(alarms, lambda alarm: alarm.problem.code in codes)


def recover_alarms(alarms: Alarms) -> Alarms:
    """Return the alarms after the operator's reset following a stop: events end, conditions stay."""
    return _end_alarms(alarms, lambda alarm: alarm.problem.code not in CONDITIONS)


def with_faults(alarms: Alarms, faults: Iterable[str], at_s: float, during: str = AT_REST) -> Alarms:
    """Return the alarms with the faults that the controller reports now.

    Each is reported by one alarm: that of the motion it has stopped, else a common one for all faults found
    `during` rest or a program. A new fault raises the alarm again; after the last of its faults an alarm ends.
    """
    now = tuple(faults)
    known = {fault for alarm in alarms if alarm.active for fault in alarm.faults}
    fresh = tuple(fault for fault in now if fault not in known)
    after = _end_alarms(alarms, lambda alarm: bool(alarm.faults) and not set(alarm.faults) & set(now))
    if not fresh:
        return after
    before = (f for alarm in after if alarm.active and alarm.problem.key == during for f in alarm.faults)
    standing = (*(fault for fault in before if fault in now), *fresh)
    problem = Problem(code=FAULT, key=during, value=", ".join(standing))
    return raise_alarm(after, problem, Priority.HIGH, at_s)


def foremost(alarms: Alarms) -> Alarm | None:
    """Return the alarm to show: unseen before seen, then by priority, active before cleared, oldest first."""
    return min(alarms, key=lambda a: (a.acknowledged, a.priority, not a.active, a.at_s), default=None)


def unacknowledged_alarms(alarms: Alarms) -> Alarms:
    """Return the unacknowledged alarms: each is shown in its turn."""
    return tuple(alarm for alarm in alarms if not alarm.acknowledged)


def _end_alarms(alarms: Alarms, over: Callable[[Alarm], bool]) -> Alarms:
    after = (replace(alarm, active=False) if over(alarm) else alarm for alarm in alarms)
    return tuple(alarm for alarm in after if alarm.active or not alarm.acknowledged)
