"""Identified responses on the disk: one file each, named by machine, path and date."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import quote

from drivers.identification.result import IdentifiedResponse, as_table, from_table
from profiles.files import printable, read_regular_file, write_atomically
from profiles.problem import Problem, ProfileError

FOLDER = "identified"
CAP_BYTES = 1_000_000


def store(data: Path, identified: IdentifiedResponse) -> Path:
    """Keep a response in the data folder, and return its file; nothing is ever overwritten.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`.
    """
    folder = _folder(data, identified.origin.machine)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        where, value = printable(str(folder)), error.strerror or str(error)
        raise ProfileError(Problem(code="file.not_writable", where=where, value=value)) from error
    # The date without marks: no file system minds it, and the names stand in the order of the dates.
    stamp = "".join(c for c in identified.date if c.isalnum())
    path = folder / f"{identified.path}-{stamp}.json"
    content = json.dumps(as_table(identified), ensure_ascii=False, allow_nan=False, indent=2)
    write_atomically(path, f"{content}\n".encode(), overwrite=False)
    return path


def load(file: Path) -> IdentifiedResponse:
    """Read one file.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`, `identify.file`.
    """
    where = printable(str(file))
    content = read_regular_file(file, cap_bytes=CAP_BYTES)
    try:
        table = json.loads(content)
    except (ValueError, RecursionError) as error:
        value = printable(str(error))
        raise ProfileError(Problem(code="identify.file", where=where, value=value)) from error
    return from_table(table, where)


def _folder(data: Path, machine: str) -> Path:
    """Return the folder of a machine, whatever its name has in it."""
    return data / FOLDER / quote(machine, safe=" ").replace(".", "%2E")
