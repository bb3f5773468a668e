"""Jobs without an operator at a screen: connect, load, clamp, home, cut, measure; and compare two parts.

After any error with the machine connected, stop it and prove it at rest before the error is raised.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol

from console.session.cut.engine import (
    CutContext,
    CutEnd,
    PartStep,
    Tell,
    cut,
    load,
    nothing_seen,
    tool_clear,
)
from console.session.cut.force_watch import ForceWatch
from console.session.cut.interlocks import of_job, of_lobe, of_zero
from console.session.cut.recording import mean_diameter_of
from console.session.cut.telemetry import CutFigures
from console.session.cut.trip_cause import with_cause
from console.session.errors import SessionError, fault_problem, refuse
from console.session.stages import Stage, air_mm, scale_path_to_stage
from drivers.cutting.planning import CutBand, CutPlan, plan_cut
from drivers.cutting.strategy import UNCOMPENSATED, Strategy
from drivers.errors import LinkError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from profiles.compensations.force_null import ForceNull
from profiles.compensations.path import CutPath, ExpectedResidual, expect_residual
from profiles.findings import Severity, refusals
from profiles.gauge import GaugeProfile
from profiles.job import Job
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile
from profiles.metrology.conformity import JudgedFigure, judge_part, passes_all
from profiles.metrology.cylindricity import LEAST_SECTIONS, CylinderResult, PartSection, evaluate_cylinder
from profiles.metrology.separation import GaugeError
from profiles.metrology.uncertainty import UncertaintyBudget, part_budget
from profiles.problem import Problem, ProblemError
from profiles.roundness import RoundnessResult, evaluate
from profiles.rules import check
from profiles.trace_files.gauge_error import sections_without, take_error_off
from profiles.trace_files.header import header_of
from profiles.traces import Trace

FILTER_UPR = 50.0  # cut-off of the roundness filter for the comparison of before and after
_PARTS = {Stage.AIR: "air", Stage.PARTIAL: "partial", Stage.FULL: "after"}

TellPart = Callable[[str, PartStep, str], None]
"""Called at each step with the part, the step, and a detail that needs no translation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPlan:
    """Planned run, judged but not begun. `warnings` are reported before anything moves.

    There is no `reference`, the same without compensation, where the controller does not drive the spindle: only a
    program that follows it can be cut there. `compensation` is the learned version, None the model's;
    `inverted` the name of the identified response, empty for the model's. `fingerprint` says how the part is
    clamped, where an indicator showed it; empty if none did.
    """

    job: Job
    machine: MachineProfile
    cut: CutPlan
    reference: CutPlan | None
    warnings: tuple[Problem, ...]
    stage: Stage = Stage.FULL
    compensation: int | None = None
    inverted: str = ""
    fingerprint: str = ""

    @property
    def expected_residual(self) -> ExpectedResidual | None:
        """Expected remaining lobe of a part cut with a fraction of its compensation; None otherwise."""
        whole_um_pp = 2.0 * self.cut.target.amplitude_um / self.stage.fraction
        return expect_residual(whole_um_pp, self.stage.fraction) if self.stage is Stage.PARTIAL else None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """Result of a run: `before` is the same job cut without compensation, `after` with the strategy.

    A part that was not cut or not measured is None. `trace` is that of the part of `after` in the middle of its
    cut, `whole` its form over the length, `budget` the uncertainty of both; `collisions` are those of the tool in
    either cut, each kind once. `force` is the check by the force of a half-stage cut.
    """

    plan: RunPlan
    simulated: bool
    before: RoundnessResult | None
    after: RoundnessResult | None
    figures: CutFigures
    collisions: tuple[str, ...]
    trace: Trace | None = None
    whole: CylinderResult | None = None
    budget: UncertaintyBudget | None = None
    force: ForceNull | None = None

    @property
    def improvement_percent(self) -> float | None:
        """Reduction of the roundness error, percent."""
        if self.before is None or self.after is None:
            return None
        if self.before.ront_um == 0.0:
            return 0.0
        return 100.0 * (self.before.ront_um - self.after.ront_um) / self.before.ront_um

    @property
    def lobe_frequency_hz(self) -> float:
        """Lobe frequency at the actual speed."""
        return self.plan.job.jaws * self.figures.spindle_speed_rpm / 60.0

    @property
    def judged(self) -> tuple[JudgedFigure, ...]:
        """Its figures against the limits of its job; none of a part not meant to be good, or not proven."""
        if self.after is None or self.plan.stage is not Stage.FULL or not self.figures.verdict.proven:
            return ()
        job, diameter_mm = self.plan.job, None if self.trace is None else mean_diameter_of(self.trace, self.after)
        off_um = None if diameter_mm is None else 1000.0 * (diameter_mm - job.finished_diameter_mm)
        return judge_part(
            job.tolerances,
            ront_um=self.after.ront_um,
            mean_um=self.after.mean_deviation_um,
            off_um=off_um,
            z_mm=middle_mm(job),
            sections=() if self.whole is None else self.whole.sections,
            cylt_um=None if self.whole is None else self.whole.cylt_um,
            uncertainty=None if self.budget is None else self.budget.expanded,
        )

    @property
    def within_tolerance(self) -> bool | None:
        """Whether the part is within all tolerances of its job over its length.

        None of one not meant to be good, not proven, or of a cylindricity that was not measured.
        """
        return passes_all(self.judged) if self.judged else None


def refuse_unplannable(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    *also: tuple[Problem, ...],
    jaw_found: bool,
    simulated: bool,
    where: str = "",
) -> None:
    """Refuse a job that does not fit the machine, with all other objections at once.

    `where` is the file that a refusal of the job names. `jaw_found`: jaw 1 was found at the machine, see
    `of_zero`. `simulated`: nothing real is cut, see `of_lobe`.
    """
    lobe = of_lobe(job, machine, strategy, simulated=simulated)
    zero = of_zero(machine, strategy, jaw_found=jaw_found)
    refuse(of_job(job, machine, where).problems, lobe.problems, zero, *also)


def plan_stage(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    stage: Stage,
    path: CutPath | None,
    *,
    watchdog: str,
    ts_ms: int | None = None,
    from_turn: int = 0,
    trimmed: bool = False,
    before: CutBand | None = None,
) -> CutPlan:
    """Plan a cut in a stage, see `plan_cut`; `path` is the learned or identified one, None for the model's."""
    plan = plan_cut(
        job,
        machine,
        strategy,
        ts_ms=ts_ms,
        from_turn=from_turn,
        watchdog=watchdog,
        path=scale_path_to_stage(job, machine, strategy, stage, path),
        air_mm=air_mm(job, stage),
        trimmed=trimmed,
        before=before,
    )
    refuse(finding.problem for finding in refusals(plan.findings))
    return plan


def plan_run(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    ts_ms: int | None = None,
    where: str = "",
    *,
    watchdog: str = "",
    stage: Stage = Stage.FULL,
    path: CutPath | None = None,
    compensation: int | None = None,
    inverted: str = "",
    simulated: bool = False,
    fingerprint: str = "",
) -> RunPlan:
    """Judge a job and plan its cuts; `ts_ms` is the TS of the `paper` strategy, None as printed.

    `where` is the file that a refusal of the job names, `watchdog` the condition without which a program ends.
    `path` was learned, as version `compensation`, or inverts the response named `inverted`; None is the model's.
    `simulated`: no real machine will cut, see `of_lobe`. Raises `ProblemError`: every refusal at once; nothing has
    been touched.
    """
    refuse_unplannable(job, machine, strategy, jaw_found=False, simulated=simulated, where=where)
    cut = plan_stage(job, machine, strategy, stage, path, watchdog=watchdog, ts_ms=ts_ms)
    reference: CutPlan | None = cut
    if stage is Stage.AIR or (cut.strategy.traits.follows_lobe and machine.spindle.followed):
        reference = None
    elif cut.strategy.traits.follows_lobe:
        reference = plan_stage(job, machine, UNCOMPENSATED, Stage.FULL, None, watchdog=watchdog)
    findings = (*check(job, machine), *cut.findings)
    return RunPlan(
        job=job,
        machine=machine,
        cut=cut,
        reference=reference,
        warnings=tuple(f.problem for f in findings if f.severity is Severity.WARNING),
        stage=stage,
        compensation=compensation,
        inverted=inverted,
        fingerprint=fingerprint,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CutOutcome:
    """Trace of the released part, figures read during the cut, and collisions of the tool.

    There is no trace without a gauge or a requested measurement. `force` is the check of sign and angle, if it was
    requested.
    """

    trace: Trace | None
    figures: CutFigures
    collisions: tuple[str, ...]
    sections: tuple[PartSection, ...] = ()
    whole: CylinderResult | None = None
    budget: UncertaintyBudget | None = None
    force: ForceNull | None = None


class CutObserver(Protocol):
    """Work done beside a cut: it is notified when the machine is ready, and gets every poll of the program."""

    def begin(self, plan: CutPlan) -> None:
        """Take notice that the machine is ready and at rest, and that the cut is about to start."""

    def see(self, snapshot: Snapshot) -> None:
        """Take a status poll during the cut."""


def cut_part(
    context: CutContext,
    job: Job,
    plan: CutPlan,
    tell: Tell,
    beside: CutObserver | None = None,
    *,
    homed: bool = False,
    blank: bool = True,
    clamped: bool = False,
    measured: bool = True,
    force: ForceWatch | None = None,
    touched_mm: float = 0.0,
    name: str = "",
    product: bool = True,
) -> CutOutcome:
    """Make one part, with the work `beside` it; a machine that is `homed` is not homed again.

    The record has it under its `name`; one for comparison is no `product`.

    Without a `blank` it is an air cut, clear of what is clamped; a blank that is `clamped` already is cut so.
    Of one that was cut before, `touched_mm` is how far. A part not to be `measured` stays clamped. With `force`,
    and no work `beside`, its force is checked.

    Raises:
        ProblemError: what went wrong, or who stopped it; the machine is at rest, or the problems say that this
            could not be proven. What is refused before any motion leaves the machine alone.
    """
    lathe = context.lathe
    context.recorder.part(name, product=product)
    watch: CutObserver | None = beside or force

    def begin(step: PartStep, detail: str) -> None:
        tell(step, detail)
        if step is PartStep.CUT and watch is not None:
            watch.begin(plan)

    def see(snapshot: Snapshot) -> None:
        if watch is not None:
            watch.see(snapshot)

    version, kind = lathe.connect()
    try:
        context.admit()
        tell(PartStep.LOAD, f"{kind} {version}")
        load(context, plan, tell, aligned=False)
        tell(PartStep.ALIGN, "")
        _switch_on(context, job, homed=homed, blank=blank and not clamped)
        end = cut(context, job, plan, begin, see, settle_tool=not homed, touched_mm=touched_mm)
        checked = None if force is None else force.result()
        return replace(_outcome(context, job, end, tell, measured=measured and blank), force=checked)
    except ProblemError as error:
        if lathe.stop.reason is None and not lathe.has_moved:
            raise
        raise _left_at_rest(lathe, plan, error) from error
    except Exception as fault:
        # A fault of the console itself must stop the machine too.
        raise _left_at_rest(lathe, plan, SessionError(fault_problem(fault))) from fault


def _switch_on(context: CutContext, job: Job, *, homed: bool, blank: bool) -> None:
    """Clamp the blank, enable the drives, and home the axes."""
    lathe = context.lathe
    if context.workshop is not None and blank:
        context.workshop.mount(job)
    lathe.snapshot()  # loading and clamping take time: another console may have taken control
    lathe.enable()
    if not homed:
        lathe.home()


def _outcome(context: CutContext, job: Job, end: CutEnd, tell: Tell, *, measured: bool) -> CutOutcome:
    if end.figures is None:
        raise SessionError(nothing_seen(job))
    workshop, gauge = context.workshop, context.gauge
    trace, sections, whole, budget = None, tuple[PartSection, ...](), None, None
    if workshop is not None and measured:
        tell(PartStep.MEASURE, "")
        error = None if gauge is None else gauge.error
        trace, sections = take_error_off(workshop.measure(), error), sections_without(workshop.sections(), error)
        whole = measured_whole(sections)
        budget = None if gauge is None else measured_budget(gauge.profile, job, trace, sections, error)
        context.recorder.record_measured_part(job, trace, whole, sections, budget)
    collisions = () if workshop is None else workshop.look().collisions
    return CutOutcome(
        trace=trace, figures=end.figures, collisions=collisions, sections=sections, whole=whole, budget=budget
    )


def _left_at_rest(lathe: Lathe, plan: CutPlan, error: ProblemError) -> SessionError:
    """Stop, wait for rest, and return the error to raise, with the state of the machine for the operator."""
    problems = error.problems
    if lathe.anothers:
        return SessionError(*problems)
    if isinstance(error, LinkError):
        lathe.in_doubt()
    if lathe.stop.reason is None:
        lathe.stop.stop(problems[0].code)
    try:
        snapshot = lathe.wait_for_rest()
    except ProblemError as unproven:
        return SessionError(*problems, *unproven.problems, Problem(code="machine.state_unknown"))
    problems = with_cause(lathe, problems)
    with suppress(ProblemError):
        # The machine is at rest, and the first error is what matters: the next cut would find the others.
        lathe.program.put_back()
    if not snapshot.homed:
        return SessionError(*problems, Problem(code="machine.tool_unknown"))
    if not tool_clear(snapshot, plan):
        # The tool may be in the part: report it, and whether the machine can retract it.
        code = "machine.tool_in_part" if snapshot.loops_closed else "machine.retract_not_possible"
        return SessionError(*problems, Problem(code=code))
    return SessionError(*problems)


def run(plan: RunPlan, open_machine: Callable[[], CutContext], tell: TellPart) -> RunResult:
    """Cut the reference part and the compensated part, each on a new machine, and compare them.

    `tell` is called with the part ("before", or as `run_once`), the step and a detail. Raises `ProblemError`: what
    went wrong; see `cut_part`.
    """
    context = open_machine()
    if plan.reference is None:
        return run_once(plan, context, tell)
    before = cut_part(
        context,
        plan.job,
        plan.reference,
        lambda step, detail: tell("before", step, detail),
        name="before",
        product=plan.cut is plan.reference,
    )
    if plan.cut is plan.reference:
        return _result(plan, context, before, before)
    context.lathe.stop.check()
    return run_once(plan, open_machine(), tell, before)


def run_once(plan: RunPlan, context: CutContext, tell: TellPart, before: CutOutcome | None = None) -> RunResult:
    """Cut only the compensated part, on an existing machine; an air cut is not measured.

    `tell` is called with the part ("after", "partial" or "air"), the step and a detail. `before` is the part cut
    without compensation, if any. Raises `ProblemError`: what went wrong; see `cut_part`.
    """
    after = cut_part(
        context,
        plan.job,
        plan.cut,
        lambda step, detail: tell(_PARTS[plan.stage], step, detail),
        measured=plan.stage is not Stage.AIR,
        force=ForceWatch(context.lathe, plan.job) if plan.stage is Stage.PARTIAL else None,
        name=_PARTS[plan.stage],
    )
    return _result(plan, context, before, after)


def _result(plan: RunPlan, context: CutContext, before: CutOutcome | None, after: CutOutcome) -> RunResult:
    earlier = () if before is None else before.collisions
    return RunResult(
        plan=plan,
        simulated=context.simulated,
        before=None if before is None or before.trace is None else roundness_of(before.trace),
        after=None if after.trace is None else roundness_of(after.trace),
        figures=after.figures,
        collisions=tuple(dict.fromkeys((*earlier, *after.collisions))),
        trace=after.trace,
        whole=after.whole,
        budget=after.budget,
        force=after.force,
    )


def measured_whole(sections: Sequence[PartSection]) -> CylinderResult | None:
    """Return the form over its length of a measured part; None where it has too few sections for it."""
    return evaluate_cylinder(sections, filter_upr=FILTER_UPR) if len(sections) >= LEAST_SECTIONS else None


def measured_budget(
    gauge: GaugeProfile | None,
    job: Job,
    trace: Trace,
    sections: Sequence[PartSection] = (),
    error: GaugeError | None = None,
) -> UncertaintyBudget | None:
    """Return the uncertainty of a part as it is measured here, None without a gauge.

    Without several `sections` it is that of the one of its trace. `error` of the gauge was taken off.
    """
    if gauge is None:
        return None
    header, _ = header_of(trace.meta)
    one = PartSection(z_mm=0.0, angle_deg=trace.angle_deg, deviation_um=trace.deviation_um)
    result = roundness_of(trace)
    return part_budget(
        gauge, sections or (one,), result, filter_upr=FILTER_UPR, header=header, job=job, error=error
    )


def roundness_of(trace: Trace) -> RoundnessResult:
    """Return the roundness by which parts are compared."""
    return evaluate(trace.angle_deg, trace.deviation_um, FILTER_UPR, state=trace.meta["state"])
