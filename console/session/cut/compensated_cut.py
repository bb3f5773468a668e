"""Compensated cuts: turn a learned path to the jaw 1 that was found, and check that it may be cut.

A version is kept with jaw 1 where the file of its job has it. The chuck may be mounted otherwise: the path is
turned by as much as the lobe is.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.session.data.identified_responses import ChosenResponse, response_problems
from console.session.data.learned_store import asked_for, find_newest_version, versions
from console.session.stages import Stage, nominal_path, not_staged
from console.session.work import Work
from drivers.cutting.strategy import Strategy
from profiles.compensations.learned_compensation import LearnedCompensation, differences
from profiles.compensations.path import CutPath
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedJob, LoadedMachine


def path_of(job: Job, filed: Job, compensation: LearnedCompensation | None) -> CutPath | None:
    """Return the learned path of a cut, None for the model's; `job` is `filed` with jaw 1 where it was found."""
    return None if compensation is None else compensation.path.turn_by(job.lobe_phase_deg - filed.lobe_phase_deg)


def compensation_problems(
    compensation: LearnedCompensation | None,
    loaded: LoadedJob | None,
    machine: LoadedMachine,
    strategy: Strategy,
    stage: Stage,
    *,
    simulated: bool,
    lathe: str = "",
    inverts: ChosenResponse | None = None,
) -> tuple[Problem, ...]:
    """Return why a part may not be cut with this compensation (None: the model's) in this stage.

    `inverts` is the identified response of a cut without one, None the model's: codes `run.two_inverses` and those
    of `response_problems`.

    `lathe` is which simulated lathe it is, "" where that is not known.
    `loaded` is the file of the job, None for one that was edited: codes `learned.edited`, those of `differences`,
    and `stage.strategy`.
    """
    problems: tuple[Problem, ...] = ()
    if compensation is not None and loaded is None:
        problems = (Problem(code="learned.edited", key=str(compensation.version)),)
    elif compensation is not None and loaded is not None:
        problems = differences(
            compensation, asked_for(loaded, machine, strategy, simulated=simulated, lathe=lathe)
        )
    if inverts is not None and compensation is not None:
        both = Problem(code="run.two_inverses", key=str(compensation.version), value=inverts.name)
        problems = (*problems, both)
    elif inverts is not None:
        problems = response_problems(inverts, machine.machine, strategy, simulated=simulated)
    if stage is Stage.PARTIAL and not strategy.traits.inverts:
        problems = (*problems, not_staged(stage, strategy))
    return problems


def with_accepted(work: Work, data: Path, *, simulated: bool, lathe: str = "") -> Work:
    """Return the work on a newly opened job, with its newest accepted version.

    Where that version does not fit this cut, or cannot be read, use the model and report it.
    """
    try:
        newest = find_newest_version(work.loaded, work.machine, data, simulated=simulated)
    except ProblemError as error:
        return replace(work, set_aside=tuple(error.problems))
    if newest is None:
        return work
    used = using(work, newest)
    problems = chosen_problems(used, simulated=simulated, lathe=lathe)
    return replace(work, set_aside=problems) if problems else used


def with_news(work: Work, data: Path, *, simulated: bool, lathe: str = "") -> Work:
    """Return the work with a notice of a newer version accepted since, as by `console learn` elsewhere.

    The choice made stays. Files that cannot be read are reported where the version is used.
    """
    try:
        newest = find_newest_version(work.loaded, work.machine, data, simulated=simulated)
    except ProblemError:
        return work
    if newest is None or work.edited or chosen_problems(using(work, newest), simulated=simulated, lathe=lathe):
        return work
    used = 0 if work.compensation is None else work.compensation.version
    if newest.version <= used or (used == 0 and work.set_aside):
        return work
    return replace(work, set_aside=(Problem(code="learned.newer", key=str(newest.version)),))


def using(work: Work, version: LearnedCompensation) -> Work:
    """Return the work with a version and the strategy it belongs to."""
    return replace(work, compensation=version, strategy=version.holds_for.strategy, set_aside=(), inverts=None)


def inverting(work: Work, chosen: ChosenResponse | None) -> Work:
    """Return the work with an identified response to invert, None for the model's, and nothing learned."""
    return replace(without_learned(work), inverts=chosen)


def inverted_path(
    job: Job, machine: MachineProfile, strategy: Strategy, inverts: ChosenResponse | None
) -> CutPath | None:
    """Return the path of a cut that inverts an identified response, None for the model's.

    Raises as `nominal_path`: the response cannot be inverted at this speed.
    """
    return None if inverts is None else nominal_path(job, machine, strategy, inverts.response)


def without_learned(work: Work) -> Work:
    """Return the work with the model's compensation; report a learned version that this sets aside."""
    learned = work.compensation
    aside: tuple[Problem, ...] = ()
    if learned is not None and not learned.is_model:
        aside = (Problem(code="learned.set_aside", key=str(learned.version)),)
    return replace(work, compensation=None, set_aside=aside)


def chosen_problems(work: Work, *, simulated: bool, lathe: str = "") -> tuple[Problem, ...]:
    """Return why the current job may not be cut with the chosen compensation and stage."""
    return compensation_problems(
        work.compensation,
        None if work.edited else work.loaded,
        work.machine,
        Strategy(work.strategy),
        Stage(work.stage),
        simulated=simulated,
        lathe=lathe,
        inverts=work.inverts,
    )


def stored_problems(compensation: LearnedCompensation, data: Path) -> tuple[Problem, ...]:
    """Return why a version differs from its file: `learned.file_changed`, or what is wrong with the file."""
    try:
        known = versions(data, compensation.holds_for)
    except ProblemError as error:
        return tuple(error.problems)
    changed = Problem(code="learned.file_changed", key=str(compensation.version))
    return () if compensation in known else (changed,)
