"""What must hold before a cut may start. Each interlock has a name, and a reason when it does not hold."""

from __future__ import annotations

from dataclasses import dataclass, replace

from console.session.errors import SessionError
from drivers.cut import CutPlan
from drivers.snapshot import AxisName, Snapshot
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.rules import check, refusals

START_BAND_COUNTS = 10.0
"""How far an axis may stand from its start position."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interlock:
    """One condition; `problems` say why it does not hold, and are empty when it does."""

    name: str
    problems: tuple[Problem, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether nothing stands in the way."""
        return not self.problems


def of_job(job: Job, machine: MachineProfile, where: str = "") -> Interlock:
    """Return whether the job fits the machine at all; `where` is the file of the job."""
    problems = tuple(replace(finding.problem, where=where) for finding in refusals(check(job, machine)))
    return Interlock(name="job_fits_machine", problems=problems)


def of_program(plan: CutPlan) -> Interlock:
    """Return whether the program stays within the machine."""
    problems = tuple(finding.problem for finding in refusals(plan.findings))
    return Interlock(name="program_is_safe", problems=problems)


def of_machine(snapshot: Snapshot, plan: CutPlan, settings: tuple[Problem, ...]) -> tuple[Interlock, ...]:
    """Return what the controller must report before the start; `settings` are its differences."""
    starts = dict(zip(AxisName, (plan.tool_start, plan.spindle_start, plan.carriage_start), strict=True))
    away = tuple(
        Problem(
            code="machine.not_at_start",
            key=axis,
            value=f"{state.position:.0f} counts",
            limit=f"{starts[axis]:.1f} ± {START_BAND_COUNTS:g} counts",
        )
        for axis, state in zip(AxisName, snapshot.axes, strict=True)
        if abs(state.position - starts[axis]) > START_BAND_COUNTS
    )
    return (
        Interlock(name="controller_verified", problems=settings),
        _yes_or_no("drives_on", snapshot.loops_closed, "machine.not_enabled"),
        _yes_or_no("homed", snapshot.homed, "machine.not_homed"),
        _yes_or_no("at_rest", snapshot.at_rest, "machine.moving"),
        Interlock(name="no_fault", problems=_faults(snapshot)),
        Interlock(name="at_start", problems=away),
    )


def refuse_unless(*interlocks: Interlock) -> None:
    """Go on only when every interlock holds.

    Raises:
        SessionError: every reason why the cut may not start.
    """
    reasons = [problem for interlock in interlocks for problem in interlock.problems]
    if reasons:
        raise SessionError(*reasons)


def _yes_or_no(name: str, holds: bool, code: str) -> Interlock:
    return Interlock(name=name, problems=() if holds else (Problem(code=code),))


def _faults(snapshot: Snapshot) -> tuple[Problem, ...]:
    # A program's run-time error is no reason: only the next start clears that bit.
    return tuple(Problem(code="machine.fault", key="arm", value=fault) for fault in snapshot.axis_faults)
