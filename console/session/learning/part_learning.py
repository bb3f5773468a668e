"""The learning step of a measured part or why it has none; keeping it, recording it, and reverting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from console.session.data.kept_files import utc_now
from console.session.data.learned_store import store, versions
from console.session.data.measured_part import CutPart, MadeWith
from console.session.data.records import add_to_run
from console.session.data.run_rows import problem_events
from console.session.data.run_story import ACCEPTED
from console.session.errors import SessionError
from console.session.learning.learning_steps import LearningOutcome, learn_from_part, revert_version
from console.session.learning.row_faults import NO_FAULTS, RowFaults
from console.session.operator import operator_name
from profiles.compensations.learned_compensation import LearnedCompensation
from profiles.compensations.next_version import LearningStep
from profiles.metrology.uncertainty import KnownGauge
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedJob, LoadedMachine
from profiles.trace_files.sections import TraceSection
from profiles.traces import Trace

RECORD_TIMEOUT_S = 1.0
"""How long an operator waits for other writers of the record."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartLearning:
    """How a part was `made`, and its learning step or why there is none: `taught` or `problems`.

    `faults` are what its record says of it with the parts before it.
    """

    made: MadeWith
    taught: LearningOutcome | None = None
    problems: tuple[Problem, ...] = ()
    faults: RowFaults = NO_FAULTS

    @property
    def reasons(self) -> tuple[Problem, ...]:
        """Why nothing of it may be kept; empty if it may."""
        return self.problems if self.taught is None else self.taught.step.reasons


def learning_of(
    job: LoadedJob | None,
    name: str,
    part: CutPart,
    trace: Trace,
    machine: LoadedMachine,
    data: Path,
    sections: Sequence[TraceSection] = (),
    gauge: KnownGauge | None = None,
) -> PartLearning:
    """Return the learning step from a part that was cut by `job` as saved; None if `name` was edited.

    An objection to learning does not invalidate the measurement.
    """
    made = part.made
    if job is None:
        return PartLearning(made=made, problems=(Problem(code="learned.edited_part", key=name),))
    try:
        how: dict[str, Any] = {"gain": None, "robust": False, "date": utc_now()}
        how |= {"tool_um": part.tool_lobe_um, "push_um": part.push_um, "sections": sections, "gauge": gauge}
        taught = learn_from_part(trace, job, machine, data, made, **how)
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
        SessionError: `learned.no_before`, the model is used; as `revert_version`.
        ProfileError: as `store`, nothing was kept; versions that cannot be read.
    """
    if used is None or used.is_model:
        raise SessionError(Problem(code="learned.no_before", key=job.job.name))
    strategy, date = used.holds_for.strategy, utc_now()
    older = revert_version(used.parent, job, machine, data, simulated=simulated, date=date, strategy=strategy)
    store(data, older)
    return older


def record_accepted(data: Path, run_id: str | None, kept: LearnedCompensation) -> tuple[Problem, ...]:
    """Add an accepted learning step to the run that its part is from; return why it could not be.

    It is kept already: that the record does not have it is reported, and no more.
    """
    if run_id is None:
        return ()
    event = {
        "version": kept.version,
        "parent": kept.parent,
        "strategy": kept.holds_for.strategy,
        "gain": kept.gain,
    }
    return record_kept(data, run_id, ACCEPTED, event)


def record_kept(data: Path, run_id: str, kind: str, event: Mapping[str, object]) -> tuple[Problem, ...]:
    """Add a kept step or lobe to the run of its part, with the operator; return why it could not be added."""
    try:
        add_to_run(data, run_id, kind, {**event, "by": operator_name()}, timeout_s=RECORD_TIMEOUT_S)
    except SessionError as refused:
        return tuple(refused.problems)
    return ()


def learning_event(learning: PartLearning) -> dict[str, object]:
    """Return a proposed learning step, or why there is none, as the run record keeps it."""
    taught = learning.taught
    reasons = problem_events(learning.reasons)
    return reasons if taught is None else {**step_event(taught.step), **reasons}


def step_event(step: LearningStep) -> dict[str, object]:
    """Return a learning step as the run record keeps it; the path itself is kept with the versions."""
    following = step.next
    return {
        "version": following.version,
        "parent": following.parent,
        "strategy": following.holds_for.strategy,
        "gain": following.gain,
        "harmonics": list(step.learned),
        "expected_ront_um": step.expected_ront_um,
        "expected_lobe_um_pp": step.expected_lobe_um_pp,
    }
