"""`console --sim --from FILE`: the simulated lathe taken up at the moment before a recorded event."""

from __future__ import annotations

import random
import sys
import tempfile
import time
from argparse import Namespace
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from console.cli.library import simulated_address
from console.flight.cli.replay import path_named
from console.flight.plain_values import to_json_value
from console.flight.recorded_forms import RecordedWork
from console.flight.recording import Recording, drop_missing_values, read_recording
from console.school.practice.as_lesson import lesson_of_practice, steps_of
from console.school.practice.practice import Practice, practice_of
from console.school.training.attempt import Attempt
from console.school.training.tries import check_trainee
from console.school.words.practice import lesson_words, practice_lines
from console.session.cut.compensated_cut import with_accepted
from console.session.data.kept_files import jobs_folder
from console.session.errors import SessionError
from console.session.station.state import SessionStart
from console.session.work import Work, open_work
from console.text.catalogue import LANGUAGES, Catalogue, load
from console.text.columns import wrap_text
from drivers.link.address import SimulatedAddress
from drivers.simulator.plant.presets import SEEDS
from drivers.simulator.plant.which_lathe import MOUNTED
from profiles.machine import OF_CALIBRATION
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, LoadedMachine, list_jobs, load_job, load_machine, save_job

WIDTH = 78


@dataclass(frozen=True, kw_only=True)
class TakenUp:
    """What a practice begins with. `folder` has the files of what is not saved; `cleanup` removes it."""

    machine: LoadedMachine
    address: SimulatedAddress
    begins: SessionStart
    attempt: Attempt
    work: Work | None
    folder: tempfile.TemporaryDirectory[str]


def taken_up(options: Namespace, data: Path, text: Catalogue) -> TakenUp:
    """Read the recording of `--from`, say what is not as it was, and wait for Enter.

    Raises:
        ProblemError: those of `read_recording` and `practice_of`; `practice.no_start`, the input has ended.
    """
    check_trainee(options.trainee or "")
    recording = read_recording(path_named(options.from_file, data))
    practice = practice_of(recording, options.before)
    folder = tempfile.TemporaryDirectory(prefix="trilobe-practice-")
    machine = machine_recorded(recording, Path(folder.name))
    address = simulated_address(options, machine.machine) or SimulatedAddress(plant=MOUNTED)
    seed = random.SystemRandom().randrange(SEEDS) if address.seed is None else address.seed
    work, saved = (
        (None, True) if practice.work is None else work_recorded(practice.work, machine, data, Path(folder.name))
    )
    if not saved:
        practice = replace(practice, otherwise=(*practice.otherwise, Problem(code="practice.job_not_saved")))
    _ask(practice, text)
    return TakenUp(
        machine=machine,
        address=replace(address, seed=seed, placed=practice.placed),
        begins=practice.begins,
        attempt=_attempt(practice, address.plant, seed, options.trainee or ""),
        work=work,
        folder=folder,
    )


def _attempt(practice: Practice, plant: str, seed: int, trainee: str) -> Attempt:
    steps = steps_of(practice, set_up=False)
    words = {language: lesson_words(practice, steps, load(language)) for language in LANGUAGES}
    lesson = lesson_of_practice(practice, words, plant=plant, seed=seed)
    return Attempt(lesson=lesson, began_s=time.monotonic(), seed=seed, trainee=trainee)


def _ask(practice: Practice, text: Catalogue) -> None:
    """Print what comes and what is not as it was, before the screen is there."""
    for line in (*practice_lines(practice, text), "", text("practice.start")):
        for row in wrap_text(line, WIDTH) or [""]:
            print(row)
    sys.stdout.flush()
    if not sys.stdin.readline():
        raise SessionError(Problem(code="practice.no_start", value=practice.recording.path.name))


def machine_recorded(recording: Recording, folder: Path) -> LoadedMachine:
    """Return the machine as it was recorded, with the file of its profile: the saved one, else one made of it."""
    header = recording.header
    machine = header.machine
    try:
        saved = load_machine(str(header.machine_path))
    except ProfileError:
        saved = None
    if saved is None or saved.sha256 != header.machine_sha256:
        saved = load_machine(str(_written_machine(to_json_value(machine), folder)))
    return replace(saved, machine=machine)


def _written_machine(values: dict[str, Any], folder: Path) -> Path:
    """Write a machine as the file of a profile; the variance of a calibration has no place there."""
    import tomlkit

    values["chuck"] = {**values["chuck"], **dict.fromkeys(OF_CALIBRATION)}
    path = folder / "lathe.toml"
    path.write_text(tomlkit.dumps(drop_missing_values(values)), encoding="utf-8")
    return path


def work_recorded(recorded: RecordedWork, machine: LoadedMachine, data: Path, folder: Path) -> tuple[Work, bool]:
    """Return the job open as it was, and whether it is saved like that."""
    saved = _find_saved_job(recorded, data)
    loaded = saved or _written_job(recorded, folder)
    work = with_accepted(open_work(loaded, machine), data, simulated=True)
    job = replace(recorded.job, note=loaded.job.note, tags=loaded.job.tags)
    return replace(work, job=job, strategy=recorded.strategy, stage=recorded.stage), saved is not None


def _find_saved_job(recorded: RecordedWork, data: Path) -> LoadedJob | None:
    """Return the saved job with the recorded hash; None where there is none."""
    entries = list_jobs(jobs_folder(data))
    for path in (Path(recorded.path), *(entry.path for entry in entries)):
        try:
            loaded = load_job(str(path))
        except ProfileError:
            continue
        if loaded.sha256 == recorded.sha256:
            return loaded
    return None


def _written_job(recorded: RecordedWork, folder: Path) -> LoadedJob:
    path = folder / "recorded.toml"
    save_job(recorded.saved, path, private=True)
    return load_job(str(path))
