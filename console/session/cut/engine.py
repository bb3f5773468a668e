"""One cut of one part: load, verify, approach, arm, start, monitor, end, prove clear.

The screens and `console run` cut with these two functions. `load` puts the program into the controller without
motion; `cut` returns only when the planned cut has been made, the tool is proven to be clear, and the controller
is set again as its profile says. Where either fails, the caller stops the machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from console.session.cut.context import CutContext
from console.session.cut.interlocks import (
    SPEED_BAND,
    START_BAND_COUNTS,
    Interlock,
    at_speed,
    of_machine,
    refuse_unless,
)
from console.session.cut.planned_cut import PlannedCut, refuse_unless_held
from console.session.cut.telemetry import CutFigures, Telemetry
from console.session.errors import SessionError
from drivers.cutting.planning import CutPlan
from drivers.errors import DriverError
from drivers.lathe.lathe import SPEED_S, Lathe
from drivers.lathe.lengths import Lengths
from drivers.lathe.safety import device_problems
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import way_problems
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

TIME_ALLOWANCE = 1.5
EXTRA_TIME_S = 5.0
"""Timeout margin of a program over its planned time: this factor, plus this time."""

RETRACT_BAND_COUNTS = 50.0
SPINDLE_TIMEOUT_S = 120.0
STILL_RPM = 0.1
AT_START = "at_start"


class Step(StrEnum):
    """Steps of a part in order."""

    LOAD = "load"
    CHECK = "check"
    ALIGN = "align"
    ARM = "arm"
    CUT = "cut"
    RETRACT = "retract"
    MEASURE = "measure"


class Observer(Protocol):
    """Observer of a cut."""

    def step(self, step: Step, detail: str) -> None:
        """Report the start of a step; `detail` needs no translation."""

    def see(self, snapshot: Snapshot) -> None:
        """Report a status poll while the program runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutEnd:
    """End of a cut: `last` proves that the tool is clear. `figures` is None where a hold left too few polls."""

    last: Snapshot
    figures: CutFigures | None
    held: bool


class NotAsPlannedError(DriverError):
    """The cut differs from its plan; `turns` is how many were cut, None while nobody could ask the controller."""

    def __init__(self, *problems: Problem, turns: float | None) -> None:
        super().__init__(*problems)
        self.turns = turns


def load(context: CutContext, plan: CutPlan, observer: Observer, *, aligned: bool) -> None:
    """Load the program of a cut and read it back, on a machine that is set as its profile says. Nothing moves.

    `aligned` means that the drives are enabled and the axes homed: all but their positions must then be as for the
    start.

    Raises:
        SessionError: what forbids the cut.
        DriverError: the controller refused a line, or holds something else.
    """
    lathe = context.lathe
    _refuse_tables(lathe)
    lathe.program.load(plan.program, plan.axis_definitions, plan.restore)
    observer.step(Step.CHECK, f"PROG {plan.program.number}")
    if aligned:
        refuse_unless(*_ready(lathe, plan, at_start=False))
    else:
        refuse_unless(Interlock(name="controller_verified", problems=lathe.verify()))


def cut(context: CutContext, job: Job, plan: CutPlan, observer: Observer, *, settle_tool: bool = True) -> CutEnd:
    """Go to the start, tool last, verify everything again, cut, and prove that the tool is clear of the part.

    Without `settle_tool` the tool is known to stand at its start, with its integrator as the last cut left it.

    Raises:
        SessionError: an interlock that is not met; `session.nothing_seen`, `machine.not_retracted`.
        NotAsPlannedError: how the cut differs from its plan: such a part is neither measured nor learned from.
        DriverError: what ended the cut.
        StoppedError: somebody stopped the machine.
    """
    lathe = context.lathe
    _refuse_changed(context, plan)
    _go_to_start(lathe, plan, settle_tool=settle_tool)
    _turn(context, job.spindle_speed_rpm)
    observer.step(Step.ARM, f"{plan.spindle_speed_rpm:.6g} rpm")
    commissioned = _commissioned(context)
    refuse_unless(*_ready(lathe, plan, at_start=True), commissioned, at_speed(lathe, job))
    refuse_unless_held(lathe, plan)
    observer.step(Step.CUT, f"{plan.duration_s:.1f} s")
    figures = _run(lathe, job, plan, observer)
    if figures is None and not lathe.program.held:
        raise SessionError(nothing_seen(job))
    _refuse_tables(lathe)
    observer.step(Step.RETRACT, "")
    last = _proven_clear(lathe, plan)
    _turn(context, 0.0)
    lathe.stop.check()  # a stop at the last moment must not be lost in a report
    return CutEnd(last=last, figures=figures, held=lathe.program.held)


def _run(lathe: Lathe, job: Job, plan: CutPlan, observer: Observer) -> CutFigures | None:
    """Run the program to its end, and compare the cut with its plan."""
    planned, telemetry = PlannedCut(lathe, plan), Telemetry(plan, lathe.machine, job.cut_length_mm)

    def see(snapshot: Snapshot) -> None:
        telemetry.see(snapshot, holding=lathe.program.held)
        planned.see(snapshot)
        observer.see(snapshot)

    lathe.program.start(plan.program.number, plan.setup.retracted)
    lathe.program.follow(see, plan.duration_s * TIME_ALLOWANCE + EXTRA_TIME_S, planned.guard)
    lathe.program.put_back()
    problems = planned.problems()
    if problems:
        raise NotAsPlannedError(*problems, turns=None if planned.end is None else planned.end.turns)
    return telemetry.figures()


def _refuse_changed(context: CutContext, plan: CutPlan) -> None:
    """Refuse any motion on a machine that has changed since loading: safety devices, settings, program."""
    lathe = context.lathe
    devices = device_problems(lathe.snapshot().inputs)
    refuse_unless(Interlock(name="safe", problems=(*devices, *way_problems(lathe.stop.way))))
    refuse_unless(*_ready(lathe, plan, at_start=False))
    refuse_unless_held(lathe, plan, tables=False)  # the table is read after the move to the start


def _ready(lathe: Lathe, plan: CutPlan, *, at_start: bool) -> tuple[Interlock, ...]:
    locks = of_machine(lathe.snapshot(), plan, lathe.machine, lathe.verify())
    return tuple(lock for lock in locks if at_start or lock.name != AT_START)


def _commissioned(context: CutContext) -> Interlock:
    return Interlock(name="commissioned", problems=context.commissioned(context.lathe.snapshot()))


def _refuse_tables(lathe: Lathe) -> None:
    """Refuse to continue while a compensation table adds to the tool position, or has left an offset there."""
    refuse_unless(Interlock(name="no_table", problems=lathe.program.tables_left()))


def _go_to_start(lathe: Lathe, plan: CutPlan, *, settle_tool: bool) -> None:
    """Move every axis to its start: the tool out first, and in again last, beside the part."""
    if lathe.snapshot().tool.position > plan.setup.retracted + START_BAND_COUNTS:
        lathe.retract(plan.setup.retracted)
    lathe.jog_to(AxisName.CARRIAGE, plan.carriage_start)
    if AxisName.SPINDLE in lathe.driven:
        lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
    lathe.jog_to(AxisName.TOOL, plan.tool_start, settle=settle_tool)


def _turn(context: CutContext, speed_rpm: float) -> None:
    """Set a spindle that the controller does not drive, and wait for its speed; 0 is off."""
    if context.workshop is None or not context.sets_spindle:
        return
    context.workshop.set_spindle(speed_rpm or None)
    for _ in range(round(SPINDLE_TIMEOUT_S / SPEED_S)):
        if abs(context.lathe.spindle_rpm() - speed_rpm) <= max(SPEED_BAND * speed_rpm, STILL_RPM):
            return


def _proven_clear(lathe: Lathe, plan: CutPlan) -> Snapshot:
    """Prove that the program has retracted the tool: the controller must report it there, with nothing moving."""
    snapshot = lathe.snapshot()
    if not snapshot.at_rest or not tool_clear(snapshot, plan):
        raise SessionError(not_retracted(snapshot, plan, lathe.machine))
    return snapshot


def nothing_seen(job: Job) -> Problem:
    """Return the problem that too few polls fell into a cut to judge it."""
    return Problem(code="session.nothing_seen", key="cut_length_mm", value=f"{job.cut_length_mm:g} mm")


def not_retracted(snapshot: Snapshot, plan: CutPlan, machine: MachineProfile) -> Problem:
    """Return the problem that the tool is not out of the part, with its position and the position clear of it."""
    value, limit = (Lengths(machine).at(AxisName.TOOL, at) for at in (snapshot.tool.position, _clear_of(plan)))
    return Problem(code="machine.not_retracted", key=AxisName.TOOL, value=value, limit=f"< {limit}")


def _clear_of(plan: CutPlan) -> float:
    return plan.setup.surface - RETRACT_BAND_COUNTS


def tool_clear(snapshot: Snapshot, plan: CutPlan) -> bool:
    """Whether the tool is out of the part of this cut."""
    return snapshot.tool.position < _clear_of(plan)
