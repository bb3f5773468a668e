"""What a measured part teaches of the next one: the part, the cut that it is from, and the versions so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.errors import SessionError
from console.session.identified_response import response_in
from console.session.learned_store import NEWEST, asked_for, chosen, versions
from console.session.made_parts import INVERTED, MadeWith, made_with, parts_made
from console.session.made_parts import MODEL as MADE_BY_MODEL
from console.session.run import FILTER_UPR
from console.session.stages import FOLLOWING, Stage, nominal_path
from drivers.cut import Strategy
from drivers.identification.nominal import nominal_response
from profiles.chucking.holding import holding_of
from profiles.files import printable
from profiles.job import Job
from profiles.learned import MODEL, LearnedCompensation, again, model_again
from profiles.machine import MachineProfile
from profiles.next_version import CutWith, Lesson, next_version
from profiles.part_waves import part_waves
from profiles.path_bounds import MOST_WAVES
from profiles.problem import Problem
from profiles.response import AMPLIFICATION_LIMIT, ServoResponse
from profiles.rules import lobe_um_per_n
from profiles.store import LoadedJob, LoadedMachine
from profiles.traces import Trace

SIMULATED = ("simulated", "yes")
"""The header line of a trace that no gauge has measured."""

OVERTONES = (1, 2, 3)
LEAST_EXTRA = 2

LEAST_FOLLOWED = 1.0 / AMPLIFICATION_LIMIT
"""Share of a command that the axis must make for a wave to be learned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Taught:
    """A lesson, of which cut it is, and what does not spoil it."""

    lesson: Lesson
    made: MadeWith
    stage: Stage
    warnings: tuple[Problem, ...]


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
    """Return what the trace of a part teaches; `said` is what is known of its cut, see `made_with`.

    `identified` is the file of the response that the cut has inverted, `extra` are further waves to be learned.

    Raises:
        ProblemError: the part is of another cut than is said, or of none that can be learned from, or `extra` of
            none that can be made (`learned.extra`); the version of the cut is not there, or for another job or
            machine; what the trace or the fit refuses.
    """
    simulated = trace.meta.get(SIMULATED[0]) == SIMULATED[1]
    asked = asked_for(job, machine, "", simulated=simulated)
    known = versions(data, asked)
    if said.get("compensation") == NEWEST and known:
        said = {**said, "compensation": str(known[-1].version)}
    if identified is not None:
        said = {**said, INVERTED: printable(identified.name)}
    made = made_with(said, trace.meta, parts_made(data, asked))
    strategy, stage = _followed(made)
    response = _inverted(made, machine.machine, identified, simulated=simulated)
    asked = replace(asked, strategy=made.strategy)
    version = chosen(made.compensation, known, asked)
    path = nominal_path(job.job, machine.machine, strategy, response) if version is None else version.path
    part = part_waves(trace, job.job, filter_upr=FILTER_UPR, extra=extra, robust=robust)
    lesson = next_version(
        CutWith(path=path, share=stage.share, version=version),
        part,
        asked,
        job.job,
        number=_next(known),
        gain=gain,
        orders=_orders(job.job, machine.machine, strategy, extra),
        response=lambda n: nominal_response(strategy, machine.machine, _hz(job.job, n)),
        scatter_um=_scatter_um(job.job, machine.machine),
        date=date,
    )
    return Taught(lesson=lesson, made=made, stage=stage, warnings=part.warnings)


def reverted(
    number: int, job: LoadedJob, machine: LoadedMachine, data: Path, *, simulated: bool, date: str
) -> LearnedCompensation:
    """Return an older version as the newest; 0 is the model, for the strategy of the newest.

    Raises:
        SessionError: as `chosen`.
        ProfileError: as `nominal_path`.
    """
    asked = asked_for(job, machine, "", simulated=simulated)
    known = versions(data, asked)
    strategies = {each.version: each.holds_for.strategy for each in known}
    strategy = strategies.get(number, strategies[known[-1].version] if known else "")
    asked = replace(asked, strategy=strategy)
    if number != MODEL or not known:
        older = chosen(str(number), known, asked)
        assert older is not None
        return again(older, _next(known), date)
    path = nominal_path(job.job, machine.machine, Strategy(strategy))
    return model_again(asked, path, _next(known), date)


def _next(known: tuple[LearnedCompensation, ...]) -> int:
    return known[-1].version + 1 if known else MODEL + 1


def _followed(made: MadeWith) -> tuple[Strategy, Stage]:
    """Return strategy and stage of a cut that followed a path; both may be the words of a trace.

    Raises:
        SessionError: `learned.not_followed`, `learned.bad_stage`.
    """
    if made.strategy not in FOLLOWING:
        limit = " | ".join(FOLLOWING)
        raise SessionError(Problem(code="learned.not_followed", key="strategy", value=made.strategy, limit=limit))
    if made.stage not in (Stage.PARTIAL, Stage.FULL):
        limit = f"{Stage.PARTIAL} | {Stage.FULL}"
        raise SessionError(Problem(code="learned.bad_stage", key="stage", value=made.stage, limit=limit))
    return Strategy(made.strategy), Stage(made.stage)


def _orders(job: Job, machine: MachineProfile, strategy: Strategy, extra: tuple[int, ...]) -> tuple[int, ...]:
    """Return the waves that can be commanded: the lobe; by a table also its overtones, and what is asked for.

    Raises:
        SessionError: `learned.extra`.
    """
    _refuse_extra(extra, job, machine, strategy)
    if strategy is not Strategy.CAM:
        return (job.jaws,)
    overtones = {job.jaws * overtone for overtone in OVERTONES}
    reached = {n for n in overtones if _followed_share(n, job, machine, strategy) >= LEAST_FOLLOWED}
    return tuple(sorted({job.jaws, *reached, *extra}))


def _refuse_extra(extra: tuple[int, ...], job: Job, machine: MachineProfile, strategy: Strategy) -> None:
    """Refuse waves that are asked for and cannot be cut, or that are the gauge's own and not the part's.

    Raises:
        SessionError: `learned.extra`, one problem for each.
    """
    if not extra:
        return
    if strategy is not Strategy.CAM:
        value, limit = f"--strategy {strategy}", f"--strategy {Strategy.CAM}"
        raise SessionError(Problem(code="learned.extra", key="--extra", value=value, limit=limit))
    problems: list[Problem] = []
    for n in extra:
        # Once in a turn a part stands beside the axis of the gauge.
        if not LEAST_EXTRA <= n <= MOST_WAVES:
            value, limit = f"{n}/rev", f"{LEAST_EXTRA}/rev … {MOST_WAVES}/rev"
            problems.append(Problem(code="learned.extra", key="--extra", value=value, limit=limit))
        elif (share := _followed_share(n, job, machine, strategy)) < LEAST_FOLLOWED:
            value, limit = f"{n}/rev (|T| = {share:.3f})", f"|T| >= {LEAST_FOLLOWED:g}"
            problems.append(Problem(code="learned.extra", key="--extra", value=value, limit=limit))
    if problems:
        raise SessionError(*problems)


def _followed_share(n: int, job: Job, machine: MachineProfile, strategy: Strategy) -> float:
    """Return how much of a command of n waves in a turn the axis makes."""
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
