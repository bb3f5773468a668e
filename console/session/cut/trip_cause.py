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
from drivers.lathe.snapshot import AxisName
from profiles.problem import Problem

BY_FRICTION, AFTER_CHANGE = "machine.tool_left_behind", "machine.behind_after_change"
IDENTIFIED = "machine.tool_left_behind_identified"


def with_cause(lathe: Lathe, problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """Return the problems of a machine at rest with the cause of a trip; what the controller does not tell stays.

    Nothing is written.
    """
    if all(problem.code != BY_FRICTION for problem in problems):
        return tuple(problems)
    changed: tuple[Problem, ...] = ()
    with suppress(DriverError):
        changed = (*lathe.verify(), *lathe.program.changes())
    if not changed:
        friction = lathe.friction()
        return tuple(_identified(problem, friction) if friction else problem for problem in problems)
    told = (_after_change(problem) if problem.code == BY_FRICTION else problem for problem in problems)
    return (*told, *(problem for problem in changed if problem not in problems))


def _identified(problem: Problem, friction: str) -> Problem:
    """Return the cause with the friction that was measured in this axis in place of what is usual."""
    return replace(problem, code=IDENTIFIED, key=friction) if problem.code == BY_FRICTION else problem


def _after_change(problem: Problem) -> Problem:
    return replace(problem, code=AFTER_CHANGE, where="", key=AxisName.TOOL)
