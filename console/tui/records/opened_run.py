"""One recorded run as it was: its story, its traces evaluated as they were then, its job and that of today."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from console.session.data.kept_files import jobs_folder
from console.session.data.run_reader import RecordedPart, RunStory, Telemetry, story
from console.session.data.run_story import POLLED
from console.session.learning.evaluated_part import EvaluatedPart, evaluated_part
from console.session.learning.run_debrief import RunDebrief, run_debrief
from profiles.job import Job
from profiles.problem import Problem, ProblemError, ProfileError
from profiles.store import LoadedMachine, list_jobs, load_job


class JobNow(StrEnum):
    """The file of a recorded job today."""

    SAME = "same"
    CHANGED = "changed"
    GONE = "gone"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenedRun:
    """A run, with its `parts` that have a trace; `job` is the one that was cut, None if it is not recorded.

    `problems` are those of its data.
    """

    story: RunStory
    parts: tuple[tuple[RecordedPart, EvaluatedPart], ...]
    job: Job | None
    job_now: JobNow
    machine_changed: bool
    debrief: RunDebrief
    problems: tuple[Problem, ...] = ()

    @property
    def trace(self) -> EvaluatedPart | None:
        """The trace of the product at spindle angles, None where there is none that can be shown."""
        product = self.story.product
        return next((found for part, found in self.parts if part is product), None)

    @property
    def telemetry(self) -> Telemetry | None:
        """The telemetry of the cut of the product, else of the last cut; None without any."""
        polled = [each for each in self.story.telemetry if each.kind == POLLED and len(each.rows)]
        name = None if self.story.product is None else self.story.product.part
        of_product = [each for each in polled if each.part == name]
        found = of_product or polled
        return found[-1] if found else None


def opened_run(data: Path, run_id: str, machine: LoadedMachine, *, explains: bool = True) -> OpenedRun:
    """Read a run, and compare its job and its machine with the files of today; `explains` as for `run_debrief`.

    Raises SessionError: as `console.session.data.run_reader.story`.
    """
    found = story(data, run_id)
    problems: list[Problem] = []
    parts: list[tuple[RecordedPart, EvaluatedPart]] = []
    for part in _last_of_each(found.parts):
        try:
            shown = evaluated_part(part, found.setup, "profile_um", on_spindle=True)
            parts += [] if shown is None else [(part, shown)]
        except ProblemError as error:
            problems += error.problems
    job = None
    try:
        job = found.read_job()
    except ProfileError as error:
        problems += error.problems
    same_machine = found.row.machine == machine.machine.name
    return OpenedRun(
        story=found,
        parts=tuple(parts),
        job=job,
        job_now=_job_now(data, found),
        machine_changed=same_machine and found.machine_sha256 != machine.sha256,
        debrief=run_debrief(found, data, explains=explains),
        problems=tuple(problems),
    )


def _last_of_each(parts: tuple[RecordedPart, ...]) -> list[RecordedPart]:
    """Return the last measurement of each part: the others were repeated."""
    return list({(part.product, part.part): part for part in parts}.values())


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
