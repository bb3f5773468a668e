"""A run as the report shows it: its story, its job as a value, its parts evaluated, and the parts before it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any

from console.session.data.run_reader import RecordedPart, RunRow, RunStory
from console.session.learning.evaluated_part import EvaluatedPart, evaluated_part
from console.session.learning.run_debrief import RunDebrief
from profiles.job import Job
from profiles.problem import Problem, ProfileError

BEFORE = "before"
MOST_POINTS = 60
"""Parts of a run chart: more would not be told apart on paper."""


Evaluation = EvaluatedPart | tuple[Problem, ...]
"""A part evaluated from its trace, or why it cannot be."""


def _evaluation(part: RecordedPart, setup: Mapping[str, Any]) -> Evaluation:
    try:
        return evaluated_part(part, setup, "result", "profile_um") or ()
    except ProfileError as refused:
        return tuple(refused.problems)
    except ValueError as refused:  # a header that no console has written
        return (Problem(code="trace.header_value", value=str(refused)),)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportedRun:
    """A run, ready to be written.

    `job` is None where its text was not kept, or cannot be read (`job_problems`). `parts` are the last
    measurements of each part, with their `evaluations` by number, `again` those that were measured again later.
    `points` are parts of the job in the
    order of manufacture, up to those of this run, None where the record of the others cannot be read. Dates are
    written in `zone`, None: that of this computer. Without a `debrief` there is no section of it.
    """

    story: RunStory
    job: Job | None
    job_problems: tuple[Problem, ...]
    parts: tuple[RecordedPart, ...]
    evaluations: Mapping[int, Evaluation]
    again: tuple[RecordedPart, ...]
    points: tuple[RecordedPart, ...] | None
    zone: tzinfo | None
    debrief: RunDebrief | None = None

    @property
    def product(self) -> RecordedPart | None:
        """The newest part that the run was for; None where it was not measured."""
        return next((part for part in reversed(self.parts) if part.product), None)

    @property
    def before(self) -> RecordedPart | None:
        """The part cut without compensation, for comparison; None without one."""
        return next((each for each in self.parts if each.part == BEFORE and not each.product), None)

    def evaluated(self, part: RecordedPart | None) -> EvaluatedPart | None:
        """Return a part with its evaluation; None without a trace, or if it cannot be evaluated."""
        found = None if part is None else self.evaluations[part.number]
        return found if isinstance(found, EvaluatedPart) else None

    def problems_of(self, part: RecordedPart) -> tuple[Problem, ...]:
        """Return why the trace of a part cannot be evaluated."""
        found = self.evaluations[part.number]
        return found if isinstance(found, tuple) else ()

    def doubts(self, part: RecordedPart) -> bool:
        """Whether record and trace of a part contradict each other."""
        found = self.evaluated(part)
        return bool((found and found.differing) or self.problems_of(part)) or not part.has_its_trace

    @property
    def contradicts_itself(self) -> bool:
        """Whether the product's recorded judgement does not follow from its recorded figures."""
        part = self.story.product
        if part is None or part.passed is None or part.tolerance_um is None:
            return False
        return part.is_good is not part.passed


def reported_run(
    story: RunStory,
    points: Sequence[RecordedPart] | None = (),
    zone: tzinfo | None = None,
    debrief: RunDebrief | None = None,
) -> ReportedRun:
    """Return a run for its report; `points` are the measured parts of its job, oldest first, None unreadable."""
    job, problems = None, tuple[Problem, ...]()
    try:
        job = story.read_job()
    except ProfileError as refused:
        problems = tuple(refused.problems)
    numbers = {part.part: part.number for part in story.parts}.values()
    last = tuple(part for part in story.parts if part.number in numbers)
    return ReportedRun(
        story=story,
        job=job,
        job_problems=problems,
        parts=last,
        evaluations={part.number: _evaluation(part, story.setup) for part in last},
        again=tuple(part for part in story.parts if part.number not in numbers),
        points=None if points is None else _up_to(story.row, points),
        zone=zone,
        debrief=debrief,
    )


def _up_to(row: RunRow, points: Sequence[RecordedPart]) -> tuple[RecordedPart, ...]:
    """Return whole parts of a run's strategy, up to those of the run; none where it has none, as never judged."""
    whole = [each for each in points if each.is_full and each.strategy == row.strategy]
    last = max((place for place, point in enumerate(whole) if point.run_id == row.run_id), default=-1)
    return tuple(whole[: last + 1][-MOST_POINTS:])
