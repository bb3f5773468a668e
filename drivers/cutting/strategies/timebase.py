"""`timebase`: the segments of `pvt` in a program whose time base is the spindle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cutting.strategies.traits import AngleZero, Made, Planning, Traits

if TYPE_CHECKING:
    from profiles.machine import MachineProfile


def _made(planning: Planning) -> Made:
    """Make the program; in each servo cycle time advances by the spindle's turn in the cycle before."""
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
    """Return the delay: a time base counts the last completed servo cycle."""
    return 1


TRAITS = Traits(
    make=_made,
    inverts=True,
    late_cycles=_late_cycles,
    spindle_time=True,
    counts_from=AngleZero.INDEX,
)
