"""Interlocks of a cut start: the reasons why it may not begin, with a name where the screens show it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import AngleZero, Strategy
from drivers.lathe.lathe import Lathe
from drivers.lathe.lengths import Lengths
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.chucking.holding import force_as_measured
from profiles.findings import Severity, refusals
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.rules import check, lobe_as_found

SPEED_BAND = 0.02
"""Allowed speed error of a spindle not driven by the controller: the servo is inverted for the job's speed."""

START_BAND_COUNTS = 10.0  # allowed distance of an axis from its start position


@dataclass(frozen=True, slots=True, kw_only=True)
class Interlock:
    """One condition of the start. Not a `Finding`: it has a name also where it is met, and any number of reasons.

    `problems` say why it is not met, and are empty when it is; `warnings` must be known before a start that is
    allowed all the same. `waits`: judged when arming.
    """

    name: str
    problems: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    waits: bool = False

    @property
    def holds(self) -> bool:
        """Whether nothing stands in the way."""
        return not self.problems


def of_drives(snapshot: Snapshot) -> Interlock:
    """Check that every loop is closed."""
    problems = () if snapshot.loops_closed else (Problem(code="alignment.drives_off"),)
    return Interlock(name="drives_on", problems=problems)


def of_home(snapshot: Snapshot) -> Interlock:
    """Check that the zeros of all axes are known."""
    return Interlock(name="homed", problems=() if snapshot.homed else (Problem(code="alignment.not_homed"),))


def of_job(job: Job, machine: MachineProfile, where: str = "") -> Interlock:
    """Check that the job fits the machine at all; `where` is the file of the job."""
    problems = tuple(replace(finding.problem, where=where) for finding in refusals(check(job, machine)))
    return Interlock(name="job_fits_machine", problems=problems)


def of_lobe(job: Job, machine: MachineProfile, strategy: Strategy, *, simulated: bool) -> Interlock:
    """Check that this cut matches the one in which the lobe error was found, with its chucking force.

    A plain cut uses no error. Where nobody can tell, a simulated lathe may still cut: that is a warning of the
    job.
    """
    found = (force_as_measured(job), *lobe_as_found(job, machine)) if strategy.traits.follows_lobe else ()
    problems = tuple(finding.problem for finding in found if finding.severity is not Severity.OK)
    borne = ("rule.lobe_unstated",) if simulated else ()
    return Interlock(name="lobe_as_found", problems=tuple(p for p in problems if p.code not in borne))


def of_machine(
    snapshot: Snapshot, plan: CutPlan, machine: MachineProfile, *, at_start: bool = True
) -> tuple[Problem, ...]:
    """Return what the controller must report otherwise before the start; `at_start` includes the positions."""
    lengths = Lengths(machine)
    starts = dict(zip(AxisName, (plan.tool_start, plan.spindle_start, plan.carriage_start), strict=True))
    away = tuple(
        Problem(
            code="machine.not_at_start",
            key=axis,
            value=lengths.format_position(axis, state.commanded_position),
            limit=lengths.format_tolerance(axis, starts[axis], START_BAND_COUNTS),
        )
        for axis, state in zip(snapshot.driven, snapshot.driven_axes, strict=True)
        # A program continues from the commanded position; friction may still hold the axis back from it.
        if abs(state.commanded_position - starts[axis]) > START_BAND_COUNTS
    )
    expected = {
        "machine.not_enabled": snapshot.loops_closed,
        "machine.not_homed": snapshot.homed,
        "machine.moving": snapshot.at_rest,
    }
    return (
        *(Problem(code=code) for code, holds in expected.items() if not holds),
        # A run-time error of an earlier program is no reason: only the next start clears that bit.
        *(Problem(code="machine.fault", key="arm", value=fault) for fault in snapshot.axis_faults),
        *(away if at_start else ()),
    )


def of_zero(machine: MachineProfile, strategy: Strategy, *, jaw_found: bool) -> tuple[Problem, ...]:
    """Return why jaw 1 is not known from the angle zero that the strategy uses, on a spindle that was never homed.

    A table counts from power-on of the controller, as does jaw 1 found at the machine (`jaw_found`);
    the spindle's time counts from the index, as does the file of a job.
    """
    counts_from = strategy.traits.counts_from if machine.spindle.followed else None
    if counts_from is AngleZero.SWITCH_ON and not jaw_found:
        return (Problem(code="cut.zero_unknown", key=strategy),)
    if counts_from is AngleZero.INDEX and jaw_found:
        return (Problem(code="cut.index_unknown", key=strategy),)
    return ()


def at_speed(lathe: Lathe, job: Job) -> tuple[Problem, ...]:
    """Return that a spindle switched and set at the lathe does not have the speed of the job."""
    if not lathe.machine.spindle.followed:
        return ()
    rpm, target_rpm = lathe.spindle_rpm(), job.spindle_speed_rpm
    band_rpm = SPEED_BAND * target_rpm
    if abs(rpm - target_rpm) <= band_rpm:
        return ()
    value, limit = f"{rpm:.1f} rpm", f"{target_rpm:.1f} ± {band_rpm:.1f} rpm"
    return (Problem(code="machine.not_at_speed", key=AxisName.SPINDLE, value=value, limit=limit),)
