"""`paper`: Prog. 1 of Lee and Lee (2001), as printed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cutting.strategies.traits import Made, Planning, Traits

if TYPE_CHECKING:
    from profiles.job import Job
    from profiles.machine import MachineProfile


def _made(planning: Planning) -> Made:
    from drivers.pmac.programs.paper import DEFAULT_TS_MS, paper_program
    from drivers.pmac.programs.setup import refuse_endless

    job, machine, setup = planning.job, planning.machine, planning.setup
    refuse_endless(2 * job.jaws * setup.turns)
    text = paper_program(job, machine, setup, DEFAULT_TS_MS if planning.ts_ms is None else planning.ts_ms)
    return Made(text=text, tool_start=setup.surface, definitions=machine.controller.axis_definitions)


def _begins_at(job: Job, machine: MachineProfile) -> float:
    from drivers.pmac.programs.paper import spindle_start_counts

    return spindle_start_counts(job, machine)


TRAITS = Traits(make=_made, takes_ts=True, begins_at=_begins_at)
