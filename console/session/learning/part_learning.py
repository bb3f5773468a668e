"""What a measured part teaches: its learning step, or why there is none; keeping that, and going back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from console.session.data.kept_files import utc_now
from console.session.data.learned_store import store, versions
from console.session.data.measured_part import CutPart, MadeWith
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
        """Why nothing of it may be kept, empty if it may."""
        return self.problems if self.taught is None else self.taught.step.reasons


def learning_of(
    job: LoadedJob | None,
    name: str,
    part: CutPart,
    trace: Trace,
    machine: LoadedMachine,
    data: Path,
) -> PartLearning:
    """Return the learning step from a part that was cut by `job` as saved; None if `name` was edited.

    An objection to learning does not invalidate the measurement.
    """
    made = part.made
    if job is None:
        return PartLearning(made=made, problems=(Problem(code="learned.edited_part", key=name),))
    try:
        how: dict[str, Any] = {"gain": None, "robust": False, "date": utc_now()}
        how |= {"tool_um": part.tool_lobe_um, "push_um": part.push_um}
        taught = taught_by(trace, job, machine, data, made, **how)
    except ProblemError as error:
        return PartLearning(made=made, problems=tuple(error.problems))
    return PartLearning(made=made, taught=taught)


def accept(learning: PartLearning, data: Path) -> LearnedCompensation:
    """Keep a part's learning step as the newest version, whatever was kept since it was measured, and return it.

    Raises:
        SessionError: why it must not be kept; `learned.accepted`, the newest version is this one.
        ProfileError: as `store`, nothing was kept; versions that cannot be read.
    """
    if learning.taught is None or learning.reasons:
        raise SessionError(*learning.reasons)
    fresh = learning.taught.step.next
    known = versions(data, fresh.holds_for)
    if known and known[-1] == replace(fresh, version=known[-1].version):
        raise SessionError(Problem(code="learned.accepted", key=str(known[-1].version)))
    kept = replace(fresh, version=known[-1].version + 1 if known else fresh.version)
    store(data, kept)
    return kept


def revert(
    used: LearnedCompensation | None, job: LoadedJob, machine: LoadedMachine, data: Path, *, simulated: bool
) -> LearnedCompensation:
    """Keep the version before the `used` one again as the newest, and return it.

    That is the version from whose part it was learned; before the first comes the model.

    Raises:
        SessionError: `learned.no_before`, the model is used; as `reverted`.
        ProfileError: as `store`, nothing was kept; versions that cannot be read.
    """
    if used is None or used.is_model:
        raise SessionError(Problem(code="learned.no_before", key=job.job.name))
    strategy, date = used.holds_for.strategy, utc_now()
    older = reverted(used.parent, job, machine, data, simulated=simulated, date=date, strategy=strategy)
    store(data, older)
    return older
