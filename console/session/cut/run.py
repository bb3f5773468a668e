"""Whole job: the part without compensation, the part with it, and the improvement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from console.session.cut.context import CutContext
from console.session.cut.engine import Step
from console.session.cut.headless import CutOutcome, cut_part
from console.session.cut.planning import planned, refuse_unplannable
from console.session.cut.telemetry import CutFigures
from console.session.stages import Stage
from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import UNCOMPENSATED, Strategy
from profiles.compensations.path import CutPath, Expected, expected
from profiles.findings import Severity
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.roundness import RoundnessResult, evaluate
from profiles.rules import check
from profiles.traces import Trace

FILTER_UPR = 50.0
"""Cut-off of the roundness filter for the comparison of before and after."""

_PARTS = {Stage.AIR: "air", Stage.PARTIAL: "partial", Stage.FULL: "after"}


TellPart = Callable[[str, Step, str], None]
"""Called at each step with the part, the step, and a detail that needs no translation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPlan:
    """Planned run, judged but not begun. `warnings` are reported before anything moves.

    There is no `reference`, the same without compensation, where the controller does not drive the spindle: only a
    program that follows it can be cut there. `compensation` is the learned version, None the model's;
    `inverted` the name of the identified response, empty for the model's.
    """

    job: Job
    machine: MachineProfile
    cut: CutPlan
    reference: CutPlan | None
    warnings: tuple[Problem, ...]
    stage: Stage = Stage.FULL
    compensation: int | None = None
    inverted: str = ""

    @property
    def expected(self) -> Expected | None:
        """Expected remaining lobe of a part cut with a fraction of its compensation; None otherwise."""
        whole_um_pp = 2.0 * self.cut.target.amplitude_um / self.stage.share
        return expected(whole_um_pp, self.stage.share) if self.stage is Stage.PARTIAL else None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """Result of a run: `before` is the same job cut without compensation, `after` with the strategy.

    A part that was not cut or not measured is None. `trace` is that of the part of `after`.

    `collisions` are those of the tool in either cut, each kind once.
    """

    plan: RunPlan
    simulated: bool
    before: RoundnessResult | None
    after: RoundnessResult | None
    figures: CutFigures
    collisions: tuple[str, ...]
    trace: Trace | None = None

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
    def within_tolerance(self) -> bool | None:
        """Whether the part is within the job's roundness tolerance; None of a part that was not meant to be."""
        if self.after is None or self.plan.stage is not Stage.FULL:
            return None
        return self.after.ront_um <= self.plan.job.roundness_tolerance_um


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
) -> RunPlan:
    """Judge a job and plan its cuts; `ts_ms` is the TS of the `paper` strategy, None as printed.

    `where` is the file that a refusal of the job names, `watchdog` the condition without which a program ends.
    `path` was learned, as version `compensation`, or inverts the response named `inverted`; None is the
    model's. `simulated`: no real machine will cut, see `of_lobe`.

    Raises:
        ProblemError: every refusal at once; nothing has been touched.
    """
    refuse_unplannable(job, machine, strategy, jaw_found=False, simulated=simulated, where=where)
    cut = planned(job, machine, strategy, stage, path, watchdog=watchdog, ts_ms=ts_ms)
    reference = None if stage is Stage.AIR else _reference(job, machine, cut, watchdog)
    findings = (*check(job, machine), *cut.findings)
    warnings = tuple(f.problem for f in findings if f.severity is Severity.WARNING)
    return RunPlan(
        job=job,
        machine=machine,
        cut=cut,
        reference=reference,
        warnings=warnings,
        stage=stage,
        compensation=compensation,
        inverted=inverted,
    )


def _reference(job: Job, machine: MachineProfile, cut: CutPlan, watchdog: str) -> CutPlan | None:
    if not cut.strategy.traits.follows_lobe:
        return cut
    if machine.spindle.followed:
        return None
    return planned(job, machine, UNCOMPENSATED, Stage.FULL, None, watchdog=watchdog)


def run(plan: RunPlan, open_machine: Callable[[], CutContext], tell: TellPart) -> RunResult:
    """Cut the reference part and the compensated part, each on a new machine, and compare them.

    `tell` is called with the part ("before", or as `run_once`), the step and a detail.

    Raises:
        ProblemError: what went wrong; see `cut_part`.
    """
    context = open_machine()
    if plan.reference is None:
        return run_once(plan, context, tell)
    before = cut_part(context, plan.job, plan.reference, lambda step, detail: tell("before", step, detail))
    after = before
    if plan.cut is not plan.reference:
        context.lathe.stop.check()
        context = open_machine()
        after = cut_part(context, plan.job, plan.cut, lambda step, detail: tell(_PARTS[plan.stage], step, detail))
    return RunResult(
        plan=plan,
        simulated=context.simulated,
        before=_roundness(before),
        after=_roundness(after),
        figures=after.figures,
        collisions=tuple(dict.fromkeys((*before.collisions, *after.collisions))),
        trace=after.trace,
    )


def run_once(plan: RunPlan, context: CutContext, tell: TellPart) -> RunResult:
    """Cut only the compensated part, on an existing machine; an air cut is not measured.

    `tell` is called with the part ("after", "partial" or "air"), the step and a detail.

    Raises:
        ProblemError: what went wrong; see `cut_part`.
    """
    after = cut_part(
        context,
        plan.job,
        plan.cut,
        lambda step, detail: tell(_PARTS[plan.stage], step, detail),
        measured=plan.stage is not Stage.AIR,
    )
    return RunResult(
        plan=plan,
        simulated=context.simulated,
        before=None,
        after=_roundness(after),
        figures=after.figures,
        collisions=after.collisions,
        trace=after.trace,
    )


def roundness_of(trace: Trace) -> RoundnessResult:
    """Return the roundness by which parts are compared."""
    return evaluate(trace.angle_deg, trace.deviation_um, FILTER_UPR, state=trace.meta["state"])


def _roundness(outcome: CutOutcome) -> RoundnessResult | None:
    return None if outcome.trace is None else roundness_of(outcome.trace)
