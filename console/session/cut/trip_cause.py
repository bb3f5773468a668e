"""Why a tool tripped on its following error: settings that another host has changed come before friction.

`machine.tool_left_behind` computes the friction that trips the tool with the gains of the machine profile, on the
path that was loaded. Where the controller holds another gain, constant, table entry or trim, that is the cause to
look at first. It is read after the machine has come to rest: nothing may wait for it before. Where the friction of
this axis was identified, its value stands beside the one that trips it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from drivers.errors import DriverError
from drivers.lathe.lathe import Lathe
from drivers.lathe.motion import BEHIND
from drivers.lathe.snapshot import AxisName
from profiles.axis.servo_gains import notch_from_variables, notch_settings
from profiles.problem import Problem

BY_FRICTION, AFTER_CHANGE = "machine.tool_left_behind", "machine.behind_after_change"
IDENTIFIED = "machine.tool_left_behind_identified"


def filter_suspected(lathe: Lathe, problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """Return that a notch filter may be read otherwise, where the tool tripped on its following error with one."""
    machine = lathe.as_set
    notch = notch_from_variables(machine)
    tripped = any(each.code == BY_FRICTION or BEHIND in each.value for each in problems)
    if not tripped or not notch:
        return ()
    filters = notch_settings(machine, notch)
    value = ", ".join(f"{name} {number:.11g}" for name, number in filters.items())
    return (Problem(code="trial.filter_suspected", value=value),)


def with_cause(lathe: Lathe, problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """Return the problems of a machine at rest with the cause of a trip; what the controller does not tell stays.

    Nothing is written.
    """
    suspected = filter_suspected(lathe, problems)
    if all(problem.code != BY_FRICTION for problem in problems):
        return (*problems, *suspected)
    changed: tuple[Problem, ...] = ()
    with suppress(DriverError):
        changed = (*lathe.verify(), *lathe.program.changes())
    if not changed:
        friction = lathe.friction()
        found = tuple(
            _name_identified_friction(problem, friction) if friction else problem for problem in problems
        )
        return (*found, *suspected)
    after_change = {"code": AFTER_CHANGE, "where": "", "key": AxisName.TOOL}
    told = (replace(each, **after_change) if each.code == BY_FRICTION else each for each in problems)
    return (*told, *(problem for problem in changed if problem not in problems), *suspected)


def _name_identified_friction(problem: Problem, friction: str) -> Problem:
    """Return the cause with the measured friction of this axis instead of the usual one."""
    return replace(problem, code=IDENTIFIED, key=friction) if problem.code == BY_FRICTION else problem
