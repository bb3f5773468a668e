"""Where the operator's data is: jobs, machines and records, by the platform's convention or as told."""

from __future__ import annotations

import os
import pwd
from pathlib import Path

from console.session.errors import SessionError
from profiles.problem import Problem

APPLICATION = "trilobe"


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
