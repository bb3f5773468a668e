"""Learning steps: from a measured part, its cut and the versions so far, to the next version."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.cut.alignment import Alignment, JawAngle, aligned_job
from console.session.cut.run import FILTER_UPR
from console.session.data.identified import response_in
from console.session.data.learned_store import NEWEST, asked_for, chosen, date_problems, versions
from console.session.data.made_parts import AS_FILED, CUT_JAW, INVERTED, MadeWith, cuts_of, made_with, parts_made
from console.session.data.made_parts import MODEL as MADE_BY_MODEL
from console.session.data.made_parts import date_problems as cut_date_problems
from console.session.errors import SessionError
from console.session.stages import Stage, nominal_path
from drivers.cutting.strategy import BY_TABLE, INVERTING, Strategy
from drivers.identification.nominal import nominal_response
from profiles.axis.response import AMPLIFICATION_LIMIT, ServoResponse
from profiles.chucking.grip import lobe_um_per_n
from profiles.chucking.holding import holding_of
from profiles.compensations.learned import MODEL, LearnedCompensation, again, model_again
from profiles.compensations.learning import coefficient_of
from profiles.compensations.next_version import CutWith, LearningStep, next_version
from profiles.compensations.part_waves import PartWaves, part_waves
from profiles.compensations.path import MOST_WAVES, CutPath, target_path
from profiles.files import printable
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.store import LoadedJob, LoadedMachine
from profiles.traces import Trace

SIMULATED = ("simulated", "yes")
"""Header line of a simulated trace, which no gauge has measured."""

OVERTONES = (1, 2, 3)
LEAST_EXTRA = 2

LEAST_FOLLOWED = 1.0 / AMPLIFICATION_LIMIT
"""Fraction of a command that the axis must follow for a harmonic to be learned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftWave:
    """Harmonic of the part, um p-p: what was left of it, and what the next should have; `learned` or noise."""

    waves: int
    left_um_pp: float
    expected_um_pp: float
    learned: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Taught:
    """A learning step, its cut, warnings, and each harmonic that could be learned."""

    lesson: LearningStep
    made: MadeWith
    stage: Stage
    warnings: tuple[Problem, ...]
    waves: tuple[LeftWave, ...]


def taught(
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
) -> Taught:
    """Return the learning step from the trace of a part; `said` is what is known of its cut, see `made_with`.

    `identified` is the file of the response that the cut has inverted, `extra` are further harmonics to learn.

    Raises:
        ProblemError: the part is not of the stated cut, or of none that can be learned from, or `extra` cannot be
            cut (`learned.extra`); the version of the cut is missing, or for another job or machine; what the trace
            or the fit refuses.
    """
    asked = asked_for(job, machine, "", simulated=_simulated(trace))
    known = versions(data, asked)
    if said.get("compensation") == NEWEST and known:
        said = {**said, "compensation": str(known[-1].version)}
    if identified is not None:
        said = {**said, INVERTED: printable(identified.name)}
    cuts = cuts_of(data, asked)
    made = made_with(said, trace.meta, parts_made(cuts))
    found = taught_by(
        trace, job, machine, data, made, identified, gain=gain, robust=robust, date=date, extra=extra
    )
    return replace(found, warnings=(*cut_date_problems(cuts, asked.job), *found.warnings))


def taught_by(
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
) -> Taught:
    """Return the learning step from a part `made` in this way; the other arguments as for `taught`.

    Versions are kept with jaw 1 where the file of the job has it. A part that was cut with jaw 1 elsewhere is
    turned there before anything is learned from it.

    Raises:
        ProblemError: as `taught`.
    """
    simulated = _simulated(trace)
    strategy, stage = _followed(made)
    asked = asked_for(job, machine, strategy, simulated=simulated)
    known = versions(data, asked)
    response = _inverted(made, machine.machine, identified, simulated=simulated)
    version = chosen(made.compensation, known, asked)
    path = nominal_path(job.job, machine.machine, strategy, response) if version is None else version.path
    part = _part(trace, job.job, made, extra, robust=robust)
    orders = _orders(job.job, machine.machine, strategy, extra)
    lesson = next_version(
        CutWith(path=path, share=stage.share, version=version, parent=_parent(version, known, job.job)),
        part,
        asked,
        job.job,
        number=_next(known),
        gain=gain,
        orders=orders,
        response=lambda n: nominal_response(strategy, machine.machine, _hz(job.job, n)),
        scatter_um=_scatter_um(job.job, machine.machine),
        date=date,
    )
    waves = tuple(_left(n, part, lesson, path, stage) for n in orders)
    warnings = (*date_problems(version), *part.warnings, *lesson.warnings)
    return Taught(lesson=lesson, made=made, stage=stage, warnings=warnings, waves=waves)


def _simulated(trace: Trace) -> bool:
    return trace.meta.get(SIMULATED[0]) == SIMULATED[1]


def _part(trace: Trace, job: Job, made: MadeWith, extra: tuple[int, ...], *, robust: bool) -> PartWaves:
    """Return the harmonics of a part, turned to where the file of its job has jaw 1."""
    as_cut = _as_cut(job, made)
    part = part_waves(trace, as_cut, filter_upr=FILTER_UPR, extra=extra, robust=robust)
    return part.turned(job.lobe_phase_deg - as_cut.lobe_phase_deg)


def _as_cut(job: Job, made: MadeWith) -> Job:
    """Return the job with jaw 1 where it was found for its cut.

    Raises:
        SessionError: `learned.bad_stage`, the trace does not state an angle.
    """
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


def _left(n: int, part: PartWaves, lesson: LearningStep, path: CutPath, stage: Stage) -> LeftWave:
    """Return a harmonic of the part, whose height falls by as much as the tool goes deeper."""
    left = part.coefficients_um[n]
    deeper = coefficient_of(lesson.next.path.target, n) - stage.share * coefficient_of(path.target, n)
    return LeftWave(
        waves=n,
        left_um_pp=2.0 * abs(left),
        expected_um_pp=2.0 * abs(left - deeper),
        learned=n in lesson.learned,
    )


def reverted(
    number: int,
    job: LoadedJob,
    machine: LoadedMachine,
    data: Path,
    *,
    simulated: bool,
    date: str,
    strategy: str | None = None,
) -> LearnedCompensation:
    """Return an older version as the newest; 0 is the model, for `strategy` (default: that of the newest).

    Raises:
        SessionError: as `chosen`.
        ProfileError: as `nominal_path`.
    """
    asked = asked_for(job, machine, "", simulated=simulated)
    known = versions(data, asked)
    strategies = {each.version: each.holds_for.strategy for each in known}
    newest = strategies[known[-1].version] if known else ""
    strategy = strategies.get(number, newest if strategy is None else strategy)
    asked = replace(asked, strategy=strategy)
    if number != MODEL or not known:
        older = chosen(str(number), known, asked)
        assert older is not None
        return again(older, _next(known), date)
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


def _next(known: tuple[LearnedCompensation, ...]) -> int:
    return known[-1].version + 1 if known else MODEL + 1


def _followed(made: MadeWith) -> tuple[Strategy, Stage]:
    """Return strategy and stage of a cut that followed a path; both may come from a trace.

    Raises:
        SessionError: `learned.not_followed`, `learned.bad_stage`.
    """
    if made.strategy not in INVERTING:
        limit = " | ".join(INVERTING)
        raise SessionError(Problem(code="learned.not_followed", key="strategy", value=made.strategy, limit=limit))
    if made.stage not in (Stage.PARTIAL, Stage.FULL):
        limit = f"{Stage.PARTIAL} | {Stage.FULL}"
        raise SessionError(Problem(code="learned.bad_stage", key="stage", value=made.stage, limit=limit))
    return Strategy(made.strategy), Stage(made.stage)


def _orders(job: Job, machine: MachineProfile, strategy: Strategy, extra: tuple[int, ...]) -> tuple[int, ...]:
    """Return the harmonics that can be commanded: the lobe; with a table also its overtones and `extra`.

    Raises:
        SessionError: `learned.extra`.
    """
    _refuse_extra(extra, job, machine, strategy)
    if not strategy.traits.by_table:
        return (job.jaws,)
    overtones = {job.jaws * overtone for overtone in OVERTONES}
    reached = {n for n in overtones if _followed_share(n, job, machine, strategy) >= LEAST_FOLLOWED}
    return tuple(sorted({job.jaws, *reached, *extra}))


def _refuse_extra(extra: tuple[int, ...], job: Job, machine: MachineProfile, strategy: Strategy) -> None:
    """Refuse extra harmonics that cannot be cut, or that are the gauge's own and not the part's.

    Raises:
        SessionError: `learned.extra`, one problem for each.
    """
    if not extra:
        return
    if not strategy.traits.by_table:
        value, limit = f"--strategy {strategy}", f"--strategy {' | '.join(BY_TABLE)}"
        raise SessionError(Problem(code="learned.extra", key="--extra", value=value, limit=limit))
    problems: list[Problem] = []
    for n in extra:
        # One undulation per revolution is the eccentricity of the part on the gauge.
        if not LEAST_EXTRA <= n <= MOST_WAVES:
            value, limit = f"{n}/rev", f"{LEAST_EXTRA}/rev … {MOST_WAVES}/rev"
            problems.append(Problem(code="learned.extra", key="--extra", value=value, limit=limit))
        elif (share := _followed_share(n, job, machine, strategy)) < LEAST_FOLLOWED:
            value, limit = f"{n}/rev (|T| = {share:.3f})", f"|T| >= {LEAST_FOLLOWED:g}"
            problems.append(Problem(code="learned.extra", key="--extra", value=value, limit=limit))
    if problems:
        raise SessionError(*problems)


def _followed_share(n: int, job: Job, machine: MachineProfile, strategy: Strategy) -> float:
    """Return the fraction of a command of n undulations per revolution that the axis follows."""
    return abs(nominal_response(strategy, machine, _hz(job, n)))


def _inverted(
    made: MadeWith, machine: MachineProfile, identified: Path | None, *, simulated: bool
) -> ServoResponse | None:
    """Return the response that the cut has inverted, None the model's.

    Raises:
        SessionError: `learned.identified`, its file was not given; see `response_in`.
        ProfileError: see `response_in`.
    """
    if made.inverted == MADE_BY_MODEL:
        return None
    if identified is None:
        raise SessionError(Problem(code="learned.identified", key="--identified", value=made.inverted))
    return response_in(identified, machine, Strategy(made.strategy), simulated=simulated)


def _hz(job: Job, waves: int) -> float:
    return waves * job.spindle_speed_rpm / 60.0


def _scatter_um(job: Job, machine: MachineProfile) -> float:
    """Return the standard deviation of the lobe's amplitude from one clamping to the next."""
    scatter_n = holding_of(machine).force_sd_share * job.chucking_force_n
    return 0.5 * lobe_um_per_n(job, machine) * scatter_n
