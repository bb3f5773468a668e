"""Calibrations on disk: one file each, never overwritten, found by their subject.

They are numbered in the order in which they were kept, as versions are, because a clock may be
wrong. Older files have a date in place of the number, and sort before all that have one.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from console.session.data.kept_files import (
    ahead_problems,
    folder_name,
    jobs_folder,
    keep_numbered,
    make_folder,
    path_exists,
    paths_in,
    read_kept_values,
)
from profiles.files import printable
from profiles.job import Job, copy_of
from profiles.problem import Problem, ProfileError
from profiles.store import BUNDLED_JOBS, LoadedJob, load_job, save_job
from profiles.strict_values import read_own

FOLDER = "calibrations"
SCHEMA = 1

_NUMBER = re.compile(r"-(\d{6})\.json")


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """One calibration: `subject` is the machine or the job with the hash of its file, or a gauge, which has none.

    `kind` is "wrench", "deflection", "lobe" or "gauge-error", `date` UTC after ISO 8601, `file` the measurement
    with its hash, `found` the fitted numbers by name. `chuck` is its chuck by name, None if not kept.
    """

    kind: str
    subject: str
    subject_sha256: str
    date: str
    file: str
    file_sha256: str
    found: Mapping[str, Any]
    chuck: str | None = None
    schema: int = SCHEMA


def store(data: Path, calibration: Calibration) -> Path:
    """Keep a calibration in the data folder, and return its file; ProfileError as `keep`."""
    kind, subject = calibration.kind, calibration.subject
    number = max((_number(file) for file in files_of(data, subject, kind)), default=0)
    return keep_numbered(_folder(data, subject), kind, number, asdict(calibration))


def files_of(data: Path, subject: str, kind: str) -> list[Path]:
    """Return the calibration files of a kind, the newest first; `file.unreadable` for a folder that is not."""
    files = [file for file in paths_in(_folder(data, subject)) if file.match(f"{kind}-*.json")]
    return sorted(files, key=lambda file: (_number(file), file.name), reverse=True)


def _number(file: Path) -> int:
    """Return the number of a file, 0 for one named by its date."""
    found = _NUMBER.search(file.name)
    return 0 if found is None else int(found[1])


def newest(data: Path, subject: str, kind: str, chuck: str) -> tuple[Path, Calibration] | None:
    """Return the newest calibration of a kind for a chuck, None where there is none; raises as `load`."""
    kept = ((file, load(file, subject, kind)) for file in files_of(data, subject, kind))
    return next((each for each in kept if each[1].chuck in (None, chuck)), None)


def date_problems(file: Path, calibration: Calibration) -> tuple[Problem, ...]:
    """Return `calibration.date_ahead` for a calibration dated in the future."""
    where = printable(str(file))
    return ahead_problems("calibration.date_ahead", [calibration.date], key=calibration.kind, where=where)


def record_problem(file: Path, why: str) -> ProfileError:
    """Return the refusal of a file that is not a calibration."""
    return ProfileError(Problem(code="calibration.record", where=printable(str(file)), value=printable(why)))


def keep_job(data: Path, loaded: LoadedJob, job: Job) -> LoadedJob:
    """Write a job over its own file, or into the operator's folder for a supplied one; return it as `load_job`."""
    if loaded.path.parent != BUNDLED_JOBS:
        save_job(job, loaded.path, overwrite=True)
        return load_job(str(loaded.path))
    folder = jobs_folder(data)
    make_folder(folder)
    paths = (folder / f"{loaded.path.stem}-{number}.toml" for number in itertools.count(2))
    path = next(path for path in paths if not path_exists(path))
    save_job(copy_of(job, path.stem, loaded.job.name), path, private=True)
    return load_job(str(path))


def load(file: Path, subject: str, kind: str) -> Calibration:
    """Return the calibration in a file.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`; `schema.unsupported`; `calibration.record`, not a
            calibration file, or not of this subject and kind.
    """
    where, code = printable(str(file)), "calibration.record"

    def judge(calibration: Calibration) -> None:
        if (calibration.subject, calibration.kind) != (subject, kind):
            raise ValueError(f"{calibration.subject}, {calibration.kind}")

    # The numbers of a fit are checked where they are used, by the names that the fit gives them.
    return read_own(Calibration, read_kept_values(file, code), schema=SCHEMA, code=code, where=where, judge=judge)


def _folder(data: Path, subject: str) -> Path:
    return data / FOLDER / folder_name(subject)
