"""Learning steps in the run record: proposed by a part, and accepted from it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from console.session.data.records import add_to_run
from console.session.data.run_rows import problem_events
from console.session.data.run_story import ACCEPTED
from console.session.errors import SessionError
from console.session.learning.part_learning import PartLearning
from console.session.operator import operator_name
from profiles.compensations.learned import LearnedCompensation
from profiles.compensations.next_version import LearningStep
from profiles.problem import Problem

RECORD_TIMEOUT_S = 1.0
"""How long an operator waits for other writers of the record."""


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
    """Add what was kept of a part to its run, with who kept it; return why it could not be added."""
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
