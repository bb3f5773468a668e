"""A recorded run, opened to be shown or reported: its job as a value, its parts evaluated, its debrief."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from enum import StrEnum
from pathlib import Path
from typing import Any

from console.session.data.kept_files import jobs_folder
from console.session.data.measured_part import RecordedPart
from console.session.data.run_reader import story
from console.session.data.run_rows import RunRow
from console.session.data.run_story import POLLED, RecordedTelemetry, RunStory
from console.session.learning.evaluated_part import EvaluatedPart, evaluate_part
from console.session.learning.run_debrief import RunDebrief, run_debrief
from profiles.job import Job
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedMachine, list_jobs, load_job

BEFORE = "before"
MOST_POINTS = 60
"""Parts of a run chart: more would not be told apart on paper."""

Evaluation = EvaluatedPart | tuple[Problem, ...]
"""A part evaluated from its trace, or why it cannot be."""


class JobNow(StrEnum):
    """Today's file of a recorded job, compared with the record."""

    SAME = "same"
    CHANGED = "changed"
    GONE = "gone"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenedRun:
    """A run with its job as it was cut, None if its text was not kept or cannot be read (`job_problems`).

    `parts` are the last measurements of each part, with their `evaluations` by number, `again` the earlier ones of
    a part that was measured again. On a page its job and machine are compared with the files of today (`job_now`,
    `machine_changed`). A report has `points`, parts of the job in the order of manufacture up to those of this
    run, None if the record of the others cannot be read, and dates in `zone`, None for that of this computer.
    """

    story: RunStory
    job: Job | None
    job_problems: tuple[Problem, ...]
    parts: tuple[RecordedPart, ...]
    evaluations: Mapping[int, Evaluation]
    again: tuple[RecordedPart, ...]
    debrief: RunDebrief | None
    points: tuple[RecordedPart, ...] | None = ()
    zone: tzinfo | None = None
    job_now: JobNow = JobNow.SAME
    machine_changed: bool = False

    @property
    def traces(self) -> tuple[tuple[RecordedPart, EvaluatedPart], ...]:
        """The parts whose trace can be shown."""
        return tuple((part, found) for part in self.parts if (found := self.evaluated(part)) is not None)

    @property
    def telemetry(self) -> RecordedTelemetry | None:
        """The telemetry of the cut of the product, else of the last cut; None without any."""
        polled = [each for each in self.story.telemetry if each.kind == POLLED and len(each.rows)]
        name = None if self.product is None else self.product.part
        found = [each for each in polled if each.part == name] or polled
        return found[-1] if found else None

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Why some of its data cannot be read."""
        return (*(each for part in self.parts for each in self.problems_of(part)), *self.job_problems)

    @property
    def product(self) -> RecordedPart | None:
        """The newest part that the run was for; None if it was not measured."""
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


def open_run(data: Path, run_id: str, machine: LoadedMachine, *, explains: bool = True) -> OpenedRun:
    """Read a run, and compare its job and its machine with the files of today; `explains` as for `run_debrief`.

    Raises SessionError: as `console.session.data.run_reader.story`.
    """
    found = story(data, run_id)
    same_machine = found.row.machine == machine.machine.name
    debrief = run_debrief(found, data, explains=explains)
    changed = same_machine and found.machine_sha256 != machine.sha256
    of = {"job_now": _job_now(data, found), "machine_changed": changed, "debrief": debrief}
    return _opened(found, "profile_um", on_spindle=True, **of)


def open_for_report(
    story: RunStory,
    points: Sequence[RecordedPart] | None = (),
    zone: tzinfo | None = None,
    debrief: RunDebrief | None = None,
) -> OpenedRun:
    """Return a run for its report; `points` are the measured parts of its job, oldest first, None unreadable."""
    known = None if points is None else _up_to(story.row, points)
    return _opened(story, "result", "profile_um", points=known, zone=zone, debrief=debrief)


def _opened(story: RunStory, *at_once: str, on_spindle: bool = False, **of: Any) -> OpenedRun:
    job, problems = None, tuple[Problem, ...]()
    try:
        job = story.read_job()
    except ProfileError as refused:
        problems = tuple(refused.problems)
    # The last measurement of each part: the others were repeated.
    numbers = {part.part: part.number for part in story.parts}.values()
    parts = tuple(part for part in story.parts if part.number in numbers)
    return OpenedRun(
        story=story,
        job=job,
        job_problems=problems,
        parts=parts,
        evaluations={part.number: _evaluation(part, story, *at_once, on_spindle=on_spindle) for part in parts},
        again=tuple(part for part in story.parts if part.number not in numbers),
        **of,
    )


def _evaluation(part: RecordedPart, story: RunStory, *at_once: str, on_spindle: bool = False) -> Evaluation:
    try:
        return evaluate_part(part, story.setup, *at_once, on_spindle=on_spindle) or ()
    except ProfileError as refused:
        return tuple(refused.problems)
    except ValueError as refused:  # a header that no console has written
        return (Problem(code="trace.header_value", value=str(refused)),)


def _up_to(row: RunRow, points: Sequence[RecordedPart]) -> tuple[RecordedPart, ...]:
    """Return full parts of a run's strategy, up to those of the run; none if it has none."""
    whole = [each for each in points if each.is_full and each.strategy == row.strategy]
    last = max((place for place, point in enumerate(whole) if point.run_id == row.run_id), default=-1)
    return tuple(whole[: last + 1][-MOST_POINTS:])


def _job_now(data: Path, found: RunStory) -> JobNow:
    """Compare with the file of that name, else with every one: its name and that of the job may differ."""
    entries = list_jobs(jobs_folder(data))
    for entry in sorted(entries, key=lambda each: each.name != found.row.job):
        try:
            loaded = load_job(str(entry.path))
        except ProfileError:
            continue
        if loaded.job.name == found.row.job:
            return JobNow.SAME if loaded.sha256 == found.job_sha256 else JobNow.CHANGED
    return JobNow.GONE
