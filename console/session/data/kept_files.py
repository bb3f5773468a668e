"""What the console keeps in its data folder, and where that is: a file a thing, plain values, none overwritten."""

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
    """Return the name of the folder of a machine or a job, whatever its own name has in it."""
    return quote(name, safe=" ").replace(".", "%2E")


def stamp(date: str) -> str:
    """Return a date without marks: no file system minds it, and names stand in the order of their dates."""
    return "".join(c for c in date if c.isalnum())


def make_folder(folder: Path) -> None:
    """Make a folder where it is missing, for its owner alone.

    Raises:
        ProfileError: `file.not_writable`.
    """
    try:
        make_private_folder(folder)
    except OSError as error:
        where, value = printable(str(folder)), error.strerror or str(error)
        raise ProfileError(Problem(code="file.not_writable", where=where, value=value)) from error


def keep(path: Path, table: Mapping[str, Any]) -> None:
    """Write a new file with its folder.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`.
    """
    make_folder(path.parent)
    content = json.dumps(table, ensure_ascii=False, allow_nan=False, indent=2)
    write_atomically(path, f"{content}\n".encode(), overwrite=False, private=True)


def kept(file: Path, code: str) -> Any:
    """Return what is in a file; `code` is that of the problem of a file that is none of ours.

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
    """Return the folder for data (XDG base directories); it need not exist.

    Raises:
        SessionError: `data.no_home`.
    """
    if told:
        return Path(told)
    base = os.environ.get("XDG_DATA_HOME", "")
    # A relative path in the variable is to be ignored (XDG Base Directory Specification).
    return (Path(base) if os.path.isabs(base) else _home() / ".local" / "share") / APPLICATION


def _home() -> Path:
    """Return the home folder of this user.

    Raises:
        SessionError: `data.no_home`, nothing says where it is.
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
