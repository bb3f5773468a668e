"""A run as the report shows it: its story, its job as a value, its parts evaluated, and the parts before it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any

from console.session.data.run_reader import PartPoint, RecordedPart, RunRow, RunStory
from console.session.learning.evaluated_part import EvaluatedPart, evaluated_part
from console.session.learning.run_debrief import RunDebrief
from console.session.stages import Stage
from profiles.job import Job
from profiles.problem import Problem, ProfileError

BEFORE = "before"
MOST_POINTS = 60
"""Parts of a run chart: more would not be told apart on paper."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportedPart:
    """A part of a run; `found` is None without a trace, or with `problems` that prevent an evaluation.

    `same_trace` is whether the trace has its recorded hash.
    """

    recorded: RecordedPart
    found: EvaluatedPart | None = None
    problems: tuple[Problem, ...] = ()
    same_trace: bool = True

    @property
    def doubtful(self) -> bool:
        """Whether record and trace contradict each other."""
        differs = self.found is not None and bool(self.found.differing)
        return bool(differs or self.problems) or not self.same_trace

    @property
    def jaw_1_deg(self) -> float | None:
        """Angle of jaw 1 in the trace, None where it is unknown."""
        return None if self.found is None else self.found.jaw_1_deg


def _reported(part: RecordedPart, setup: Mapping[str, Any]) -> ReportedPart:
    if part.trace is None:
        return ReportedPart(recorded=part)
    same = part.trace_sha256 in (None, hashlib.sha256(part.trace).hexdigest())
    found, problems = None, tuple[Problem, ...]()
    try:
        found = evaluated_part(part, setup, "result", "profile_um")
    except ProfileError as refused:
        problems = tuple(refused.problems)
    except ValueError as refused:  # a header that no console has written
        problems = (Problem(code="trace.header_value", value=str(refused)),)
    return ReportedPart(recorded=part, found=found, problems=problems, same_trace=same)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportedRun:
    """A run, ready to be written.

    `job` is None where its text was not kept, or cannot be read (`job_problems`). `parts` are the last
    measurements of each part, `again` those that were measured again later. `points` are parts of the job in the
    order of manufacture, up to those of this run, None where the record of the others cannot be read. Dates are
    written in `zone`, None: that of this computer. Without a `debrief` there is no section of it.
    """

    story: RunStory
    job: Job | None
    job_problems: tuple[Problem, ...]
    parts: tuple[ReportedPart, ...]
    again: tuple[RecordedPart, ...]
    points: tuple[PartPoint, ...] | None
    zone: tzinfo | None
    debrief: RunDebrief | None = None

    @property
    def product(self) -> ReportedPart | None:
        """The newest part that the run was for; None where it was not measured."""
        return next((part for part in reversed(self.parts) if part.recorded.product), None)

    @property
    def before(self) -> ReportedPart | None:
        """The part cut without compensation, for comparison; None without one."""
        return next((p for p in self.parts if p.recorded.part == BEFORE and not p.recorded.product), None)

    @property
    def contradicts_itself(self) -> bool:
        """Whether the product's recorded judgement does not follow from its recorded figures."""
        part = self.story.product
        if part is None or part.passed is None or part.tolerance_um is None:
            return False
        return part.is_good is not part.passed


def reported_run(
    story: RunStory,
    points: Sequence[PartPoint] | None = (),
    zone: tzinfo | None = None,
    debrief: RunDebrief | None = None,
) -> ReportedRun:
    """Return a run for its report; `points` are the measured parts of its job, oldest first, None unreadable."""
    job, problems = None, tuple[Problem, ...]()
    try:
        job = story.read_job()
    except ProfileError as refused:
        problems = tuple(refused.problems)
    last = {part.part: part.number for part in story.parts}
    return ReportedRun(
        story=story,
        job=job,
        job_problems=problems,
        parts=tuple(_reported(part, story.setup) for part in story.parts if last[part.part] == part.number),
        again=tuple(part for part in story.parts if last[part.part] != part.number),
        points=None if points is None else _up_to(story.row, points),
        zone=zone,
        debrief=debrief,
    )


def _up_to(row: RunRow, points: Sequence[PartPoint]) -> tuple[PartPoint, ...]:
    """Return whole parts of a run's strategy, up to those of the run; none where it has none, as never judged."""
    whole = [each for each in points if each.stage in (None, Stage.FULL) and each.strategy == row.strategy]
    last = max((place for place, point in enumerate(whole) if point.run_id == row.run_id), default=-1)
    return tuple(whole[: last + 1][-MOST_POINTS:])
