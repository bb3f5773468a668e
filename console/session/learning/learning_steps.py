"""Learning steps: from a measured part, its cut and the versions so far, to the next version; and keeping it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from console.session.cut.alignment import Alignment, JawAngle, aligned_job
from console.session.cut.run import FILTER_UPR
from console.session.data.identified_responses import kept_file, response_in
from console.session.data.learned_store import (
    NEWEST,
    asked_for,
    choose_version,
    date_problems,
    lathe_problems,
    versions,
)
from console.session.data.measured_part import (
    AS_FILED,
    CUT_JAW,
    INVERTED,
    CutPart,
    MadeWith,
    cuts_of,
    made_with,
    parts_made,
    push_um,
    tool_lobe_um,
)
from console.session.data.measured_part import MODEL as MADE_BY_MODEL
from console.session.data.measured_part import date_problems as cut_date_problems
from console.session.errors import SessionError, refuse
from console.session.force_record import ForceCheck
from console.session.learning.fingerprint import of_mean_clamping
from console.session.stages import Stage, nominal_path
from drivers.cutting.strategy import BY_TABLE, INVERTING, Strategy
from drivers.identification.nominal import follows_by_order
from drivers.simulator.plant.which_lathe import LATHE
from profiles.arrays import read_only
from profiles.axis.response import AMPLIFICATION_LIMIT, ServoResponse
from profiles.chucking.grip import force_sd_n, lobe_um_per_n
from profiles.compensations.axial_learning import fit_axial
from profiles.compensations.certificate import (
    OrderStatus,
    ToolResponse,
    certify_push,
    is_promised,
    promised_orders,
    refuse_orders,
)
from profiles.compensations.hypotheses import PartEvidence
from profiles.compensations.learned_compensation import (
    MODEL,
    HoldsFor,
    LearnedCompensation,
    history_of,
    model_again,
    renew_version,
)
from profiles.compensations.learning import coefficient_of
from profiles.compensations.next_version import AppliedPath, LearningStep, next_version
from profiles.compensations.part_harmonics import PartHarmonics, part_harmonics, seen_orders
from profiles.compensations.path import MOST_HARMONICS, MOST_MEAN_UM, CutPath, target_path
from profiles.compensations.push import left_along_um
from profiles.files import printable
from profiles.job import Job
from profiles.lobe.along import along_cut, known_within
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import PartSection
from profiles.metrology.uncertainty import KnownGauge
from profiles.problem import Problem
from profiles.store import LoadedJob, LoadedMachine
from profiles.trace_files.header import header_of
from profiles.trace_files.sections import TraceSection
from profiles.traces import Trace

SIMULATED = ("simulated", "yes")  # header line of a simulated trace, which no gauge has measured
OVERTONES = (1, 2, 3)
LEAST_EXTRA = 2

LEAST_FOLLOWED = 1.0 / AMPLIFICATION_LIMIT
"""Fraction of a command that the axis must follow for a harmonic to be learned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftHarmonic:
    """Harmonic of the part, um p-p: its residual, and the expected one of the next; `learned` or noise."""

    order: int
    left_um_pp: float
    expected_um_pp: float
    learned: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningOutcome:
    """A learning step, its cut, warnings, and each harmonic that could be learned.

    `evidence` is what the part is for a diagnosis, as far as its trace and its cut tell; None without its angles.
    """

    step: LearningStep
    made: MadeWith
    stage: Stage
    warnings: tuple[Problem, ...]
    harmonics: tuple[LeftHarmonic, ...]
    evidence: PartEvidence | None = None


def learn_from_trace(
    trace: Trace,
    job: LoadedJob,
    machine: LoadedMachine,
    data: Path,
    said: Mapping[str, str],
    identified: Path | None = None,
    *,
    gain: float | None,
    robust: bool,
    date: str,
    extra: tuple[int, ...] = (),
    sections: Sequence[TraceSection] = (),
    gauge: KnownGauge | None = None,
) -> LearningOutcome:
    """Return the learning step from the trace of a part; `said` states its cut, see `made_with`.

    `identified` is the file of the response that the cut has inverted, `extra` are further harmonics to learn.
    `gauge` has measured it: each order is at least as uncertain as that says.

    Raises:
        ProblemError: the part is of another simulated lathe than the recorded cuts; it is not of the stated
            cut, or of none that can be learned from, or `extra` cannot be
            cut (`learned.extra`); the version of the cut is missing, or for another job or machine; what the trace
            or the fit refuses.
    """
    asked = asked_for(job, machine, "", simulated=is_simulated(trace), lathe=lathe_of(trace))
    known = versions(data, asked)
    if said.get("compensation") == NEWEST and known:
        said = {**said, "compensation": str(known[-1].version)}
    if identified is not None:
        said = {**said, INVERTED: printable(identified.name)}
    cuts = cuts_of(data, asked)
    made = made_with(said, trace.meta, parts_made(cuts))
    its = next((data for kind, data, _ in cuts if made in parts_made([(kind, data, "")])), "{}")
    how: dict[str, Any] = {"gain": gain, "robust": robust, "date": date, "extra": extra}
    how |= {"tool_um": tool_lobe_um(its), "push_um": push_um(its), "sections": sections, "gauge": gauge}
    found = learn_from_part(trace, job, machine, data, made, identified, **how)
    return replace(found, warnings=(*cut_date_problems(cuts, asked.job), *found.warnings))


def learn_from_part(
    trace: Trace,
    job: LoadedJob,
    machine: LoadedMachine,
    data: Path,
    made: MadeWith,
    identified: Path | None = None,
    *,
    gain: float | None,
    robust: bool,
    date: str,
    extra: tuple[int, ...] = (),
    tool_um: complex = 0j,
    push_um: float = 0.0,
    sections: Sequence[TraceSection] = (),
    gauge: KnownGauge | None = None,
) -> LearningOutcome:
    """Return the learning step from a part `made` in this way; the other arguments as for `learn_from_trace`.

    `sections` of it teach what changes along Z.

    `tool_um` is the tool error of its cut at the order of the lobe, with jaw 1 as then; `push_um` the push left.
    Versions are kept with jaw 1 as in the file of the job; a part cut with jaw 1 elsewhere is turned there first.
    """
    filed, of = job.job, RecordedCut(trace=trace, job=job, machine=machine, made=made, tool_um=tool_um)
    read = _read_part(of, data, identified, extra=extra, robust=robust, gauge=gauge)
    known, asked, follows, orders, beside = read.known, read.asked, read.follows, read.orders, read.beside
    part, cut, stage, strategy = read.part, read.cut, read.stage, Strategy(made.strategy)
    fitted: dict[str, Any] = {"extra": extra, "beside": beside, "robust": robust, "gauge": gauge}
    scatter = scatter_um(filed, machine.machine)
    how: dict[str, Any] = {"gain": gain, "orders": orders, "beside": beside, "asked": extra, "date": date}
    of_trace = partial(_part, job=filed, made=made, **fitted)
    parts = parts_along(sections, filed, machine.machine, push_um, of_trace)
    header, _ = header_of(trace.meta)
    sized = header.radius_mm is not None and header.size != "relative"
    how |= {"along": fit_axial(parts, along_cut(filed, machine.machine), (*orders, *beside), sized=sized)}
    how |= {"in_phase": not strategy.traits.by_table, "known_within": known_within(filed, machine.machine)}
    step = next_version(cut, part, asked, filed, number=_next(known), scatter_um=scatter, follows=follows, **how)
    step = _mark_repeated_trace(_compensate_push(step, push_um), known)
    harmonics = tuple(_left_harmonic(n, part, step, cut.path, stage) for n in sorted({*orders, *step.learned}))
    if step.reasons:
        step = replace(step, learned=(), certificate=refuse_orders(step.certificate))
    return LearningOutcome(
        step=step,
        made=made,
        stage=stage,
        warnings=(
            *date_problems(cut.version),
            *lathe_problems(cut.version, asked),
            *part.warnings,
            *step.warnings,
        ),
        harmonics=harmonics,
        evidence=read.evidence,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedCut:
    """A part by its trace, how it was made, and the tool's error in its cut at the order of the lobe, um."""

    trace: Trace
    job: LoadedJob
    machine: LoadedMachine
    made: MadeWith
    tool_um: complex = 0j


@dataclass(frozen=True, slots=True, kw_only=True)
class _ReadPart:
    """The harmonics of a part, its cut, the versions known, and the orders of its strategy."""

    asked: HoldsFor
    known: tuple[LearnedCompensation, ...]
    follows: Callable[[int], ToolResponse]
    orders: tuple[int, ...]
    beside: tuple[int, ...]
    part: PartHarmonics
    cut: AppliedPath
    stage: Stage

    @property
    def evidence(self) -> PartEvidence | None:
        """What the part is for a diagnosis, None without its angles."""
        target = self.cut.path.target
        return (
            PartEvidence(
                left_um=seen_orders(self.part),
                path_um=self.cut.fraction * coefficient_of(target, target.lobes),
                tool_um=self.cut.tool_um or None,
                ront_um=self.part.ront_um(),
            )
            if self.part.is_placed
            else None
        )


def evidence_from(of: RecordedCut, data: Path) -> PartEvidence:
    """Return what a part is for a diagnosis; raises as `learn_from_part`, and why its angles are not known."""
    read = _read_part(of, data)
    if read.evidence is None:
        raise SessionError(*read.part.reasons)
    return read.evidence


def _read_part(
    of: RecordedCut,
    data: Path,
    identified: Path | None = None,
    *,
    extra: tuple[int, ...] = (),
    robust: bool = False,
    gauge: KnownGauge | None = None,
) -> _ReadPart:
    trace, made, filed, machine = of.trace, of.made, of.job.job, of.machine.machine
    strategy, stage = _strategy_and_stage(made)
    asked = asked_for(of.job, of.machine, strategy, simulated=is_simulated(trace), lathe=lathe_of(trace))
    known = versions(data, asked)
    inverted = _inverted_response(made, machine, identified, data, simulated=asked.simulated)
    version = choose_version(made.compensation, known, asked)
    path = nominal_path(filed, machine, strategy, inverted) if version is None else version.path
    follows = follows_by_order(strategy, machine, filed.spindle_speed_rpm, inverted)
    orders = _orders(filed, strategy, extra, follows)
    beside = _further_orders(strategy, orders, follows)
    part = _part(trace, filed, made, extra=extra, beside=beside, robust=robust, gauge=gauge)
    cut = _cut_with(path, stage, version, known, filed)
    cut = replace(cut, tool_um=of.tool_um * cmath.exp(-1j * filed.jaws * math.radians(_turned_deg(filed, made))))
    cut, part = of_mean_clamping(cut, part, made.fingerprint, filed.jaws, lambda n: follows(n).response)
    return _ReadPart(
        asked=asked, known=known, follows=follows, orders=orders, beside=beside, part=part, cut=cut, stage=stage
    )


def sections_like(trace: Trace, sections: Iterable[PartSection]) -> tuple[TraceSection, ...]:
    """Return sections with what is said of a trace of the same placement, at the angles of which they are."""
    return tuple(
        TraceSection(
            z_mm=each.z_mm,
            trace=replace(trace, angle_deg=read_only(each.angle_deg), deviation_um=read_only(each.deviation_um)),
        )
        for each in sections
    )


def parts_along(
    sections: Iterable[TraceSection],
    job: Job,
    machine: MachineProfile,
    push_um: float,
    harmonics: Callable[[Trace], PartHarmonics],
) -> list[tuple[float, PartHarmonics]]:
    """Return the `harmonics` of the sections within the cut, each with its place s.

    The mean is without what `push_um` has left, which the path makes up for by itself.
    """
    half_mm, found = job.cut_length_mm / 2.0, []
    for each in sections:
        past_mm = math.inf if each.z_mm is None else middle_mm(job) - each.z_mm
        if abs(past_mm) <= half_mm:
            part = harmonics(each.trace)
            left_um = float(left_along_um(push_um, job, machine, past_mm)) if push_um else 0.0
            found.append((past_mm / half_mm, replace(part, mean_um=part.mean_um - left_um)))
    return found


def _compensate_push(step: LearningStep, push_um: float) -> LearningStep:
    """Return a step whose path makes up for so much more push; if no cut takes that, the step with a warning."""
    path, rows = step.next.path.add_push(push_um), step.certificate
    if (most_um := abs(path.command.push_um)) <= MOST_MEAN_UM:
        certificate = (*rows, *certify_push(push_um))
        return replace(step, next=replace(step.next, path=path), certificate=certificate)
    value, limit = f"{most_um:.1f} um", f"<= {MOST_MEAN_UM:.1f} um"
    beyond = Problem(code="learned.push_beyond", value=value, limit=limit)
    refused = certify_push(push_um, OrderStatus.REFUSED)
    return replace(step, warnings=(*step.warnings, beyond), certificate=(*rows, *refused))


def _mark_repeated_trace(step: LearningStep, known: tuple[LearnedCompensation, ...]) -> LearningStep:
    """Return a step, with `learned.same_trace` where its trace has taught a version as a part cut otherwise.

    Two parts of a real lathe are never the same to the last digit; those of an ideal simulated one may be.
    """
    fresh = step.next
    if fresh.holds_for.simulated or fresh.part is None:
        return step
    seen = (fresh.part.ront_um, fresh.part.lobe_sd_um)
    parts = [(each, each.part) for each in known if each.reverts is None and each.parent != fresh.parent]
    others = [each for each, part in parts if part is not None and (part.ront_um, part.lobe_sd_um) == seen]
    if not others:
        return step
    reason = Problem(code="learned.same_trace", key=str(others[-1].version))
    return replace(step, reasons=(*step.reasons, reason))


def _turned_deg(filed: Job, made: MadeWith) -> float:
    """Return the angle from jaw 1 as found for a cut to jaw 1 of the job's file."""
    return filed.lobe_phase_deg - as_cut(filed, made).lobe_phase_deg


def is_simulated(trace: Trace) -> bool:
    """Whether a trace is of a simulated part."""
    return trace.meta.get(SIMULATED[0]) == SIMULATED[1]


def lathe_of(trace: Trace) -> str:
    """Return the simulated lathe on which the part of a trace was cut, "" if unknown."""
    return trace.meta.get(LATHE, "") if is_simulated(trace) else ""


def _part(trace: Trace, job: Job, made: MadeWith, **fitted: Any) -> PartHarmonics:
    """Return the harmonics of a part, turned to where the file of its job has jaw 1."""
    part = part_harmonics(trace, as_cut(job, made), filter_upr=FILTER_UPR, **fitted)
    return part.turn_by(_turned_deg(job, made))


def as_cut(job: Job, made: MadeWith) -> Job:
    """Return the job with jaw 1 as found for its cut; `learned.bad_stage` if that is no angle."""
    if made.cut_jaw_1_deg == AS_FILED:
        return job
    try:
        jaw_1_deg = float(made.cut_jaw_1_deg)
    except ValueError:
        jaw_1_deg = math.nan
    if not 0.0 <= jaw_1_deg < 360.0:
        limit = f"{AS_FILED} | 0 … 360 deg"
        raise SessionError(Problem(code="learned.bad_stage", key=CUT_JAW, value=made.cut_jaw_1_deg, limit=limit))
    found = aligned_job(job, Alignment(jaw=JawAngle(angle_deg=jaw_1_deg, jaws=job.jaws, at="")))
    return replace(found, assumed=tuple(key for key in job.assumed if key != "lobe_phase_deg"))


def check_of(part: CutPart | None, job: Job) -> ForceCheck | None:
    """Return the force check of a recorded part, for its `job` as filed; raises as `as_cut`."""
    if part is None or part.force is None:
        return None
    return ForceCheck(job=as_cut(job, part.made), found=part.force)


def _left_harmonic(n: int, part: PartHarmonics, step: LearningStep, path: CutPath, stage: Stage) -> LeftHarmonic:
    """Return a harmonic of the part, whose height falls by as much as the tool goes deeper."""
    left = part.coefficients_um[n]
    deeper = coefficient_of(step.next.path.target, n) - stage.fraction * coefficient_of(path.target, n)
    expected_um_pp = 2.0 * abs(left - deeper)
    return LeftHarmonic(
        order=n, left_um_pp=2.0 * abs(left), expected_um_pp=expected_um_pp, learned=n in step.learned
    )


def revert_version(
    number: int,
    job: LoadedJob,
    machine: LoadedMachine,
    data: Path,
    *,
    simulated: bool,
    date: str,
    strategy: str | None = None,
) -> LearnedCompensation:
    """Return an older version as the newest; 0 is the model, for `strategy` (default: that of the newest)."""
    asked = asked_for(job, machine, "", simulated=simulated)
    known = versions(data, asked)
    strategies = {each.version: each.holds_for.strategy for each in known}
    newest = strategies[known[-1].version] if known else ""
    strategy = strategies.get(number, newest if strategy is None else strategy)
    asked = replace(asked, strategy=strategy)
    if number != MODEL or not known:
        older = choose_version(str(number), known, asked)
        assert older is not None
        return renew_version(older, _next(known), date)
    path = nominal_path(job.job, machine.machine, Strategy(strategy))
    return model_again(asked, path, _next(known), date)


def _parent(
    version: LearnedCompensation | None, known: tuple[LearnedCompensation, ...], job: Job
) -> CutPath | None:
    """Return the path of the part that a version was learned from; its target is what matters."""
    if version is None:
        return None
    if version.parent == MODEL:
        return CutPath(target=target_path(job), command=target_path(job))
    return next((each.path for each in known if each.version == version.parent), None)


def _cut_with(
    path: CutPath,
    stage: Stage,
    version: LearnedCompensation | None,
    known: tuple[LearnedCompensation, ...],
    filed: Job,
) -> AppliedPath:
    parent, history = _parent(version, known, filed), history_of(version, known)
    return AppliedPath(path=path, fraction=stage.fraction, version=version, parent=parent, history=history)


def _next(known: tuple[LearnedCompensation, ...]) -> int:
    return known[-1].version + 1 if known else MODEL + 1


def _strategy_and_stage(made: MadeWith) -> tuple[Strategy, Stage]:
    """Return strategy and stage of a cut that followed a path; both may come from a trace."""
    if made.changed:  # along the cut: which of it a trace has measured is not known
        raise SessionError(Problem(code="learned.changed_in_cut", value=made.changed))
    if made.strategy not in INVERTING:
        limit = " | ".join(INVERTING)
        raise SessionError(Problem(code="learned.not_followed", key="strategy", value=made.strategy, limit=limit))
    if made.stage not in (Stage.PARTIAL, Stage.FULL):
        limit = f"{Stage.PARTIAL} | {Stage.FULL}"
        raise SessionError(Problem(code="learned.bad_stage", key="stage", value=made.stage, limit=limit))
    return Strategy(made.strategy), Stage(made.stage)


def _orders(
    job: Job, strategy: Strategy, extra: tuple[int, ...], follows: Callable[[int], ToolResponse]
) -> tuple[int, ...]:
    """Return the harmonics that can be commanded: the lobe; with a table also its overtones and `extra`.

    Refuses extra harmonics that cannot be cut, or that are the gauge's own and not the part's (`learned.extra`).
    """
    if not strategy.traits.by_table:
        if extra:
            raise SessionError(_bad_extra(f"--strategy {strategy}", f"--strategy {' | '.join(BY_TABLE)}"))
        return (job.jaws,)
    problems: list[Problem] = []
    for n in extra:
        # One undulation per revolution is the eccentricity of the part on the gauge.
        if not LEAST_EXTRA <= n <= MOST_HARMONICS:
            problems.append(_bad_extra(f"{n}/rev", f"{LEAST_EXTRA}/rev … {MOST_HARMONICS}/rev"))
        elif (followed := abs(follows(n).response)) < LEAST_FOLLOWED:
            problems.append(_bad_extra(f"{n}/rev (|T| = {followed:.3f})", f"|T| >= {LEAST_FOLLOWED:g}"))
    refuse(problems)
    overtones = (job.jaws * overtone for overtone in OVERTONES)
    reached = {n for n in overtones if is_promised(follows(n), LEAST_FOLLOWED)}
    return tuple(sorted({job.jaws, *reached, *extra}))


def _further_orders(
    strategy: Strategy, orders: tuple[int, ...], follows: Callable[[int], ToolResponse]
) -> tuple[int, ...]:
    """Return the further harmonics that a table can cut with a promise to converge; none without a table."""
    if not strategy.traits.by_table:
        return ()
    return tuple(n for n in promised_orders(follows, LEAST_FOLLOWED) if n not in orders)


def _bad_extra(value: str, limit: str) -> Problem:
    return Problem(code="learned.extra", key="--extra", value=value, limit=limit)


def _inverted_response(
    made: MadeWith, machine: MachineProfile, identified: Path | None, data: Path, *, simulated: bool
) -> ServoResponse | None:
    """Return the response that the cut has inverted, None the model's; `learned.identified` without its file.

    Without a file it is the one kept under that name.
    """
    if made.inverted == MADE_BY_MODEL:
        return None
    identified = identified or kept_file(data, machine, made.inverted)
    if identified is None:
        raise SessionError(Problem(code="learned.identified", key="--identified", value=made.inverted))
    return response_in(identified, machine, Strategy(made.strategy), simulated=simulated).response


def scatter_um(job: Job, machine: MachineProfile) -> float:
    """Return the standard deviation of the lobe's amplitude from one clamping to the next."""
    return 0.5 * lobe_um_per_n(job, machine) * force_sd_n(job, machine)
