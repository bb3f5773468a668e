"""Tries on disk: a file for each that was ended, by trainee and lesson. They can be exported and deleted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from console.school.training.attempt import Attempt
from console.school.training.debrief import FULL, Debrief, ScoreItem
from console.school.training.happenings import Happening
from console.session.data.kept_files import file_errors, folder_name, keep_numbered, paths_in, read_kept_values
from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.strict_values import read_own, record

FOLDER = "training"
LEFT = "left"  # in the folder of a trainee: tries that were left, by lesson
NOBODY = "-"  # the folder of tries without a name
SCHEMA = 1
UNREADABLE = "training.unreadable"
NAME_CAP = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Try:
    """A try as it was kept: when it was ended (UTC, ISO 8601), on which lathe, its score, and how long it took.

    `marks` and `happened` are those of the debrief, as plain values.
    """

    lesson: str
    trainee: str
    date: str
    plant: str
    seed: int | None
    blind: bool
    score: int
    took_s: float
    marks: tuple[Mapping[str, Any], ...]
    happened: tuple[Mapping[str, Any], ...]
    schema: int = SCHEMA


def check_trainee(name: str) -> None:
    """Refuse a name that no list could show. Raises ProfileError: `training.trainee`."""
    if len(name) > NAME_CAP or not name.isprintable() or name != name.strip():
        value, limit = printable(name, NAME_CAP), str(NAME_CAP)
        raise ProfileError(Problem(code="training.trainee", value=value, limit=limit))


def try_of(attempt: Attempt, debrief: Debrief, now_s: float) -> Try:
    """Return a try as it is kept."""
    lesson = attempt.lesson
    return Try(
        lesson=lesson.name,
        trainee=attempt.trainee,
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        plant=Path(lesson.plant_of(attempt.seed)).stem,
        seed=attempt.seed,
        blind=lesson.blind,
        score=debrief.score,
        took_s=round(attempt.took_s(now_s), 1),
        marks=tuple(asdict(mark) for mark in debrief.marks),
        happened=tuple(asdict(each) for each in attempt.happened),
    )


def keep_try(data: Path, one: Try) -> Path:
    """Keep a try, and return its file. Raises ProfileError: `file.not_writable`."""
    folder = trainee_folder(data, one.trainee)
    return keep_numbered(folder, folder_name(one.lesson), len(_files(folder)), asdict(one))


def trainee_folder(data: Path, trainee: str) -> Path:
    """Return where the tries of a trainee are kept."""
    return data / FOLDER / (folder_name(trainee) or NOBODY)


def tries(data: Path, trainee: str | None = None, lesson: str | None = None) -> tuple[Try, ...]:
    """Return what was kept, the oldest first: of one trainee or of all, of one lesson or of all.

    Raises ProfileError: `training.unreadable`, with the file; a folder that is closed.
    """
    found = [_read(file) for file in files_of(data, trainee, lesson)]
    return tuple(sorted(found, key=lambda each: each.date))


def told_again(one: Try) -> tuple[Debrief, tuple[Happening, ...]]:
    """Return the debrief of a try that was kept, and what happened in it. Raises ProfileError as `tries`."""
    try:
        marks = tuple(record(ScoreItem, mark) for mark in one.marks)
        return Debrief(score=one.score, marks=marks), tuple(record(Happening, each) for each in one.happened)
    except (TypeError, ValueError) as error:
        value = printable(" ".join(str(error).split()))
        raise ProfileError(Problem(code=UNREADABLE, where=one.lesson, value=value)) from error


def files_of(data: Path, trainee: str | None = None, lesson: str | None = None) -> tuple[Path, ...]:
    """Return the files of the tries of one trainee or of all, of one lesson or of all."""
    folders = [trainee_folder(data, trainee)] if trainee is not None else sorted(paths_in(data / FOLDER))
    files = (file for folder in folders for file in _files(folder))
    stem = None if lesson is None else folder_name(lesson)
    return tuple(file for file in files if stem in (None, file.stem.rpartition("-")[0]))


def left_files(data: Path, trainee: str, lesson: str | None = None) -> tuple[Path, ...]:
    """Return the files of the tries of a trainee that were left, of one lesson or of all."""
    files = _files(trainee_folder(data, trainee) / LEFT)
    return tuple(file for file in files if lesson is None or file.stem == folder_name(lesson))


def delete(files: Iterable[Path]) -> int:
    """Delete files of tries; return how many. Raises ProfileError: `file.not_writable`."""
    number = 0
    for file in files:
        with file_errors("file.not_writable", file):
            file.unlink()
        number += 1
    return number


def _files(folder: Path) -> list[Path]:
    with file_errors("file.unreadable", folder):
        return sorted(folder.glob("*.json"))


def _read(file: Path) -> Try:
    return read_own(
        Try,
        read_kept_values(file, UNREADABLE),
        schema=SCHEMA,
        code=UNREADABLE,
        where=printable(str(file)),
        judge=_judge,
    )


def _judge(one: Try) -> None:
    if not 0 <= one.score <= FULL:
        raise ValueError(f"score {one.score}")
