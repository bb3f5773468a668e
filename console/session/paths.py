"""Where the operator's data is: jobs, machines and records, by the platform's convention or as told."""

from __future__ import annotations

import os
from pathlib import Path

APPLICATION = "trilobe"


def data_folder(told: str | None = None) -> Path:
    """Return the folder for data (XDG base directories); it need not exist."""
    if told:
        return Path(told)
    base = os.environ.get("XDG_DATA_HOME", "")
    # A relative path in the variable is to be ignored (XDG Base Directory Specification).
    return (Path(base) if os.path.isabs(base) else Path.home() / ".local" / "share") / APPLICATION


def jobs_folder(data: Path) -> Path:
    """Return the folder of the operator's own jobs."""
    return data / "jobs"


def machines_folder(data: Path) -> Path:
    """Return the folder of the site's own machines."""
    return data / "machines"
