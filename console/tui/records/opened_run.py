"""One recorded run as it was: its story, its traces evaluated as they were then, its job and that of today."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Any

from console.session.data.kept_files import jobs_folder
from console.session.data.run_reader import RecordedPart, RunStory, Telemetry, story
from console.session.data.run_story import POLLED
from console.session.learning.imported import on_the_spindle, one_turn
from console.session.learning.run_debrief import RunDebrief, run_debrief
from profiles.arrays import Floats
from profiles.job import Job, job_from_table
from profiles.problem import Problem, ProblemError, ProfileError
from profiles.roundness import centred_profile
from profiles.store import LoadedMachine, list_jobs, load_job
from profiles.strict_values import number_or_none
from profiles.trace_files.header import header_of
from profiles.traces import Trace, parse_trace


class JobNow(StrEnum):
    """The file of a recorded job today."""

    SAME = "same"
    CHANGED = "changed"
    GONE = "gone"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedTrace:
    """A trace as the page plots it: M angles, deg, and M deviations from its circle, um, filtered as then.

    `turn` is the trace itself, of one turn. `jaw_1_deg` is None where the angles are not tied to the chuck.
    """

    part: RecordedPart
    turn: Trace
    angle_deg: Floats
    profile_um: Floats
    jaw_1_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenedRun:
    """A run; `job` is the one that was cut, None where it is not recorded. `problems` are those of its data."""

    story: RunStory
    traces: tuple[RecordedTrace, ...]
    job: Job | None
    job_now: JobNow
    machine_changed: bool
    debrief: RunDebrief
    problems: tuple[Problem, ...] = ()

    @property
    def product(self) -> RecordedPart | None:
        """The last measured product, as the list of runs judges it; None without one."""
        return next((part for part in reversed(self.story.parts) if part.product), None)

    @property
    def trace(self) -> RecordedTrace | None:
        """The trace of the product, None where there is none that can be shown."""
        product = self.product
        return next((each for each in self.traces if each.part is product), None)

    @property
    def telemetry(self) -> Telemetry | None:
        """The telemetry of the cut of the product, else of the last cut; None without any."""
        polled = [each for each in self.story.telemetry if each.kind == POLLED and len(each.rows)]
        name = None if self.product is None else self.product.part
        of_product = [each for each in polled if each.part == name]
        found = of_product or polled
        return found[-1] if found else None


def opened_run(data: Path, run_id: str, machine: LoadedMachine, *, explains: bool = True) -> OpenedRun:
    """Read a run, and compare its job and its machine with the files of today; `explains` as for `run_debrief`.

    Raises SessionError: as `console.session.data.run_reader.story`.
    """
    found = story(data, run_id)
    problems: list[Problem] = []
    traces: list[RecordedTrace] = []
    for part in _last_of_each(found.parts):
        try:
            traces += _traced(part, found.setup)
        except ProblemError as error:
            problems += error.problems
    job = None
    try:
        job = None if found.job_text is None else job_from_table(tomllib.loads(found.job_text))
    except ProfileError as error:
        problems += error.problems
    except tomllib.TOMLDecodeError as error:
        problems.append(Problem(code="session.fault", value=" ".join(str(error).split())))
    same_machine = found.row.machine == machine.machine.name
    return OpenedRun(
        story=found,
        traces=tuple(traces),
        job=job,
        job_now=_job_now(data, found),
        machine_changed=same_machine and found.machine_sha256 != machine.sha256,
        debrief=run_debrief(found, data, explains=explains),
        problems=tuple(problems),
    )


def _last_of_each(parts: tuple[RecordedPart, ...]) -> list[RecordedPart]:
    """Return the last measurement of each part: the others were repeated."""
    return list({(part.product, part.part): part for part in parts}.values())


def traced(found: RunStory, part: str) -> RecordedTrace | None:
    """Return the trace of a product of a run, None where none was kept. ProfileError: it cannot be read."""
    for each in reversed(_last_of_each(found.parts)):
        if each.product and each.part == part:
            return next(_traced(each, found.setup), None)
    return None


def _traced(part: RecordedPart, setup: Mapping[str, Any]) -> Iterator[RecordedTrace]:
    """Yield the trace of a part, nothing without one. ProfileError: it cannot be read."""
    if part.trace is None:
        return
    trace = parse_trace(part.trace, where=part.trace_name or "")
    answers = part.data.get("answers")
    if isinstance(answers, dict):
        given = {key: value for key, value in answers.items() if isinstance(value, str)}
        trace = replace(trace, meta=MappingProxyType({**trace.meta, **given}))
    header, _ = header_of(trace.meta)
    turn = one_turn(trace, header)
    jaw_1_deg = number_or_none(part.data.get("jaw_1_deg", setup.get("jaw_1_deg"))) if header.phase_known else None
    if jaw_1_deg is not None:
        turn = on_the_spindle(turn, header, jaw_1_deg)
    profile_um = centred_profile(turn.angle_deg, turn.deviation_um, number_or_none(part.data.get("filter_upr")))
    yield RecordedTrace(part=part, turn=turn, angle_deg=turn.angle_deg, profile_um=profile_um, jaw_1_deg=jaw_1_deg)


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
