"""Health tests on disk: one file each, never overwritten, numbered in the order in which they were made."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from console.session.data.kept_files import folder_name, keep_numbered, numbered_files, read_kept_values
from drivers.identification.health import HealthResult, as_table, from_table
from profiles.files import printable
from profiles.problem import Problem, ProfileError

FOLDER = "health"
_NUMBER = re.compile(r"health-(\d{6})\.json")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptHealth:
    """One file of a machine: its test, or why it cannot be read."""

    file: Path
    result: HealthResult | None
    problems: tuple[Problem, ...] = ()


def store(data: Path, result: HealthResult) -> Path:
    """Keep a test in the data folder, and return its file; ProfileError as `keep`."""
    folder = data / FOLDER / folder_name(result.origin.machine)
    number = max((number for number, _ in numbered_files(folder, _NUMBER)), default=0)
    return keep_numbered(folder, "health", number, as_table(result))


def kept_tests(data: Path, machine: str, most: int) -> tuple[KeptHealth, ...]:
    """Return the newest tests of a machine, the newest first, at most so many; ProfileError `file.unreadable`."""
    folder = data / FOLDER / folder_name(machine)
    return tuple(_read(file) for _, file in numbered_files(folder, _NUMBER)[:most])


def _read(file: Path) -> KeptHealth:
    where = printable(str(file))
    try:
        return KeptHealth(file=file, result=from_table(read_kept_values(file, "health.file"), where))
    except ProfileError as error:
        return KeptHealth(file=file, result=None, problems=tuple(error.problems))
