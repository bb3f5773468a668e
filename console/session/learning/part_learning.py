"""Learning on the screen: what a cut and measured part teaches, and accepting or reverting it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.dates import utc_now
from console.session.data.learned_store import store, versions
from console.session.data.made_parts import MadeWith
from console.session.errors import SessionError
from console.session.learning.learning_steps import Taught, reverted, taught_by
from profiles.compensations.learned import LearnedCompensation
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedJob, LoadedMachine
from profiles.traces import Trace


@dataclass(frozen=True, slots=True, kw_only=True)
class PartLearning:
    """How a part was `made`, and its learning step or why there is none: `taught` or `problems`."""

    made: MadeWith
    taught: Taught | None = None
    problems: tuple[Problem, ...] = ()

    @property
    def reasons(self) -> tuple[Problem, ...]:
        """Why nothing of it may be kept, empty where it may."""
        return self.problems if self.taught is None else self.taught.lesson.reasons


def learning_of(
    job: LoadedJob | None, name: str, made: MadeWith, trace: Trace, machine: LoadedMachine, data: Path
) -> PartLearning:
    """Return the learning step from the part of a cut, `made` by `job` as saved; None where `name` was edited.

    An objection to learning does not invalidate the measurement.
    """
    if job is None:
        return PartLearning(made=made, problems=(Problem(code="learned.edited_part", key=name),))
    try:
        taught = taught_by(trace, job, machine, data, made, gain=None, robust=False, date=utc_now())
    except ProblemError as error:
        return PartLearning(made=made, problems=tuple(error.problems))
    return PartLearning(made=made, taught=taught)


def accept(lesson: PartLearning, data: Path) -> LearnedCompensation:
    """Keep a part's learning step as the newest version, whatever was kept since it was measured, and return it.

    Raises:
        SessionError: why it must not be kept; `learned.accepted`, the newest version is this one.
        ProfileError: as `store`, nothing was kept; versions that cannot be read.
    """
    if lesson.taught is None or lesson.reasons:
        raise SessionError(*lesson.reasons)
    fresh = lesson.taught.lesson.next
    known = versions(data, fresh.holds_for)
    if known and known[-1] == replace(fresh, version=known[-1].version):
        raise SessionError(Problem(code="learned.accepted", key=str(known[-1].version)))
    kept = replace(fresh, version=known[-1].version + 1 if known else fresh.version)
    store(data, kept)
    return kept


def revert(
    used: LearnedCompensation | None, job: LoadedJob, machine: LoadedMachine, data: Path, *, simulated: bool
) -> LearnedCompensation:
    """Keep the version before the one that is `used` again as the newest, and return it.

    That is the version from whose part it was learned; before the first comes the model.

    Raises:
        SessionError: `learned.no_before`, the model is used; as `reverted`.
        ProfileError: as `store`, nothing was kept; versions that cannot be read.
    """
    if used is None or used.is_model:
        raise SessionError(Problem(code="learned.no_before", key=job.job.name))
    older = reverted(
        used.parent,
        job,
        machine,
        data,
        simulated=simulated,
        date=utc_now(),
        strategy=used.holds_for.strategy,
    )
    store(data, older)
    return older
