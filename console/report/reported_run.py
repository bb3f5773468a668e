"""A run as the report shows it: its story, its job as a value, its parts evaluated, and the parts before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import tzinfo
from typing import Any

from console.report.evaluated import EvaluatedPart, evaluated
from console.session.data.run_reader import PartPoint, RecordedPart, RunStory
from console.session.learning.run_debrief import RunDebrief
from console.session.stages import Stage
from profiles.files import parse_toml
from profiles.job import Job, job_from_table
from profiles.problem import Problem, ProfileError

BEFORE = "before"
MOST_POINTS = 60
"""Parts of a run chart: more would not be told apart on paper."""


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
    parts: tuple[EvaluatedPart, ...]
    again: tuple[RecordedPart, ...]
    points: tuple[PartPoint, ...] | None
    zone: tzinfo | None
    debrief: RunDebrief | None = None

    @property
    def product(self) -> EvaluatedPart | None:
        """The newest part that the run was for; None where it was not measured."""
        return next((part for part in reversed(self.parts) if part.recorded.product), None)

    @property
    def before(self) -> EvaluatedPart | None:
        """The part cut without compensation, for comparison; None without one."""
        return next((p for p in self.parts if p.recorded.part == BEFORE and not p.recorded.product), None)

    @property
    def setup(self) -> dict[str, Any]:
        """Forces and alignment of the cut; of a run of an older console from the event that armed it."""
        if self.story.setup:
            return dict(self.story.setup)
        return next((dict(event.data) for event in self.story.events if event.kind == "armed"), {})

    @property
    def diameter_passes(self) -> bool | None:
        """Whether the mean diameter of the product is within its tolerance; None where that is not judged."""
        off_um = self.diameter_off_um
        if off_um is None or self.product is None or self.product.recorded.passed is None:
            return None
        most_um = self.product.recorded.diameter_tolerance_um
        return None if most_um is None else abs(off_um) <= most_um

    @property
    def diameter_off_um(self) -> float | None:
        """How much the product is larger than its nominal diameter, um; None where either is not known."""
        recorded = None if self.product is None else self.product.recorded
        if recorded is None or recorded.diameter_mm is None or recorded.nominal_diameter_mm is None:
            return None
        return 1000.0 * (recorded.diameter_mm - recorded.nominal_diameter_mm)

    @property
    def contradicts_itself(self) -> bool:
        """Whether the product's recorded judgement does not follow from its recorded figures."""
        recorded = None if self.product is None else self.product.recorded
        if recorded is None or recorded.passed is None or recorded.tolerance_um is None:
            return False
        good = recorded.ront_um <= recorded.tolerance_um and self.diameter_passes is not False
        return good is not recorded.passed


def reported_run(
    story: RunStory,
    points: Sequence[PartPoint] | None = (),
    zone: tzinfo | None = None,
    debrief: RunDebrief | None = None,
) -> ReportedRun:
    """Return a run for its report; `points` are the measured parts of its job, oldest first, None unreadable."""
    job, problems = _job_of(story)
    last = {part.part: part.number for part in story.parts}
    jaw_1_deg = _jaw_of(story)
    return ReportedRun(
        story=story,
        job=job,
        job_problems=problems,
        parts=tuple(evaluated(part, jaw_1_deg) for part in story.parts if last[part.part] == part.number),
        again=tuple(part for part in story.parts if last[part.part] != part.number),
        points=None if points is None else _up_to(story.row.run_id, points),
        zone=zone,
        debrief=debrief,
    )


def _job_of(story: RunStory) -> tuple[Job | None, tuple[Problem, ...]]:
    if story.job_text is None:
        return None, ()
    try:
        return job_from_table(parse_toml(story.job_text.encode("utf-8", "replace"), "")), ()
    except ProfileError as refused:
        return None, tuple(refused.problems)


def _jaw_of(story: RunStory) -> float | None:
    stated = story.setup.get("jaw_1_deg")
    return float(stated) if isinstance(stated, int | float) and not isinstance(stated, bool) else None


def _up_to(run_id: str, points: Sequence[PartPoint]) -> tuple[PartPoint, ...]:
    """Return whole parts up to those of a run; none where it has none, such as a part that was never judged."""
    whole = [point for point in points if point.stage in (None, Stage.FULL)]
    last = max((place for place, point in enumerate(whole) if point.run_id == run_id), default=-1)
    return tuple(whole[: last + 1][-MOST_POINTS:])
