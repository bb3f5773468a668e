"""Identified responses on the disk: one file each, named by machine, path and date."""

from __future__ import annotations

from pathlib import Path

from console.session.kept_files import folder_name, keep, kept, stamp
from drivers.identification.result import IdentifiedResponse, as_table, from_table
from profiles.files import printable

FOLDER = "identified"


def store(data: Path, identified: IdentifiedResponse) -> Path:
    """Keep a response in the data folder, and return its file; nothing is ever overwritten.

    Raises:
        ProfileError: `file.exists`, `file.not_writable`.
    """
    folder = data / FOLDER / folder_name(identified.origin.machine)
    path = folder / f"{identified.path}-{stamp(identified.date)}.json"
    keep(path, as_table(identified))
    return path


def load(file: Path) -> IdentifiedResponse:
    """Read one file.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`, `identify.file`.
    """
    return from_table(kept(file, "identify.file"), printable(str(file)))
