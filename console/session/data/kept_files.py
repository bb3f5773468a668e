"""Files in the data folder, and where that is: one file each, plain values, never overwritten."""

from __future__ import annotations

import json
import os
import pwd
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from console.session.errors import SessionError
from profiles.files import make_private_folder, printable, read_regular_file, write_atomically
from profiles.own_values import from_json
from profiles.problem import Problem, ProfileError

CAP_BYTES = 1_000_000

APPLICATION = "trilobe"


def folder_name(name: str) -> str:
    """Return the folder name of a machine or a job, safe whatever characters its own name has."""
    return quote(name, safe=" ").replace(".", "%2E")


def stamp(date: str) -> str:
    """Return a date without punctuation: valid on any file system, and sorted by date."""
    return "".join(c for c in date if c.isalnum())


def make_folder(folder: Path) -> None:
    """Create a folder where it is missing, accessible to its owner alone.

    Raises:
        ProfileError: `file.not_writable`.
    """
    try:
        make_private_folder(folder)
    except OSError as error:
        where, value = printable(str(folder)), error.strerror or str(error)
        raise ProfileError(Problem(code="file.not_writable", where=where, value=value)) from error


def keep(path: Path, table: Mapping[str, Any]) -> None:
    """Write a new file, creating its folder.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`.
    """
    make_folder(path.parent)
    content = json.dumps(table, ensure_ascii=False, allow_nan=False, indent=2)
    write_atomically(path, f"{content}\n".encode(), overwrite=False, private=True)


def kept(file: Path, code: str) -> Any:
    """Return the values in a file; `code` is the problem code of a file that is not ours.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`; `code`.
    """
    content = read_regular_file(file, cap_bytes=CAP_BYTES)
    try:
        return from_json(content)
    except ValueError as error:
        where, value = printable(str(file)), printable(str(error))
        raise ProfileError(Problem(code=code, where=where, value=value)) from error


def data_folder(told: str | None = None) -> Path:
    """Return the data folder (XDG base directories); it need not exist.

    Raises:
        SessionError: `data.no_home`.
    """
    if told:
        return Path(told)
    base = os.environ.get("XDG_DATA_HOME", "")
    # The XDG Base Directory Specification says to ignore a relative path in the variable.
    return (Path(base) if os.path.isabs(base) else _home() / ".local" / "share") / APPLICATION


def _home() -> Path:
    """Return the home folder of this user.

    Raises:
        SessionError: `data.no_home`, it cannot be determined.
    """
    told = os.environ.get("HOME", "")
    if os.path.isabs(told):
        return Path(told)
    try:
        return Path(pwd.getpwuid(os.getuid()).pw_dir)
    except KeyError as error:
        raise SessionError(Problem(code="data.no_home", value=str(os.getuid()))) from error


def jobs_folder(data: Path) -> Path:
    """Return the folder of the operator's own jobs."""
    return data / "jobs"


def machines_folder(data: Path) -> Path:
    """Return the folder of the site's own machines."""
    return data / "machines"
