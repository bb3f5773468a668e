"""`timebase`: the segments of `pvt` in a program whose time is the turning of the spindle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cutting.strategies.traits import AngleZero, Made, Planning, Traits

if TYPE_CHECKING:
    from profiles.machine import MachineProfile


def _made(planning: Planning) -> Made:
    """The time of a servo cycle is what the spindle has turned in the one before."""
    from drivers.pmac.programs.timebase import (
        released_definitions,
        restoring_lines,
        spindle_clock,
        timebase_program,
    )

    job, machine, setup, dialect = planning.job, planning.machine, planning.setup, planning.dialect
    definitions, _ = released_definitions(machine)
    return Made(
        text=timebase_program(job, machine, setup, planning.command, dialect),
        tool_start=setup.retracted,
        definitions=definitions,
        restore=restoring_lines(machine, dialect),
        clock=spindle_clock(job, machine, dialect),
    )


def _late_cycles(machine: MachineProfile) -> int:
    """A time base counts the servo cycle that has ended."""
    return 1


TRAITS = Traits(
    make=_made,
    inverts=True,
    late_cycles=_late_cycles,
    spindle_time=True,
    counts_from=AngleZero.INDEX,
)
