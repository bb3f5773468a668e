"""What a backup of the data folder holds: a gzipped tar of folders and files, and at its end a manifest of them.

What belongs to running consoles (locks, marks of runs, temporary files, SQLite's own files) is not in it.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from console.session.data.record_file import BESIDE_RECORDS
from profiles.files import MOST_DEPTH, is_temporary
from profiles.strict_values import from_json

SCHEMA = 1
MANIFEST = "trilobe-backup.json"
CONTENT = "data/"
MANIFEST_CAP_BYTES = 64_000_000

OF_RUNNING_CONSOLES = ("locks", "running", "feed", "program-log")
RINGS = "flight/running"  # of the flight recorder
CLONE = ".git"


@dataclass(frozen=True, slots=True)
class StoredFile:
    """One file of a backup."""

    bytes: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """All that is in a backup, by its path below the data folder."""

    files: Mapping[str, StoredFile]
    folders: tuple[str, ...]
    software: str
    created_utc: str

    @property
    def total_bytes(self) -> int:
        """Size of all files."""
        return sum(each.bytes for each in self.files.values())


class OtherSchemaError(ValueError):
    """A manifest of another schema, which is the argument."""


def manifest_text(manifest: Manifest) -> bytes:
    """Return the manifest as it is stored."""
    table = {
        "schema": SCHEMA,
        "software": manifest.software,
        "created_utc": manifest.created_utc,
        "folders": list(manifest.folders),
        "files": {
            path: {"bytes": each.bytes, "sha256": each.sha256} for path, each in sorted(manifest.files.items())
        },
    }
    return (json.dumps(table, indent=1) + "\n").encode("ascii")  # names that are no UTF-8 are escaped


def manifest_from(content: bytes) -> Manifest:
    """Return the manifest that was stored. Raises `OtherSchemaError`, or another `ValueError`: it is none."""
    table = from_json(content)
    if not isinstance(table, dict) or "schema" not in table:
        raise ValueError("no schema")
    if type(table["schema"]) is not int or table["schema"] != SCHEMA:
        raise OtherSchemaError(table["schema"])
    try:
        files = {
            path: StoredFile(int(each["bytes"]), str(each["sha256"])) for path, each in table["files"].items()
        }
        folders = tuple(map(str, table["folders"]))
        return Manifest(
            files=files, folders=folders, software=str(table["software"]), created_utc=str(table["created_utc"])
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{type(error).__name__}: {error}") from error


def is_safe(path: str) -> bool:
    """Whether a path of an archive stays below the data folder, and is none of what is never restored."""
    parts = PurePosixPath(path).parts
    plain = bool(parts) and "/".join(parts) == path and ".." not in parts and not path.startswith("/")
    return plain and "\0" not in path and len(parts) <= MOST_DEPTH and not belongs_to_running(path)


def is_of_clone(path: str) -> bool:
    """Whether something belongs to a clone of git, whose configuration and hooks name programs."""
    return CLONE in path.lower().split("/")


def belongs_to_running(path: str) -> bool:
    """Whether something in the data folder is of use only while a console runs."""
    first, _, rest = path.partition("/")
    ring = f"{path}/".startswith(f"{RINGS}/")
    return ring or first in OF_RUNNING_CONSOLES or (not rest and first in BESIDE_RECORDS) or is_temporary(path)


@dataclass(frozen=True, slots=True)
class FolderEntry:
    """One entry of the data folder: its path below it, and its type as `stat` has it."""

    path: str
    mode: int

    @property
    def is_folder(self) -> bool:
        """Whether it is a folder, not a link to one."""
        return stat.S_ISDIR(self.mode)

    @property
    def is_file(self) -> bool:
        """Whether it is a regular file, not a link to one."""
        return stat.S_ISREG(self.mode)

    @property
    def is_kept(self) -> bool:
        """Whether a backup has it."""
        plain = self.is_folder or self.is_file
        return plain and self.path.count("/") < MOST_DEPTH and not is_of_clone(self.path)


def entries_of(data: Path, below: str = "") -> Iterator[FolderEntry]:
    """Yield all entries of the data folder but those of running consoles, sorted. Raises OSError."""
    with os.scandir(data / below) as scanned:
        entries = sorted(scanned, key=lambda entry: entry.name)
    for entry in entries:
        path = below + entry.name
        if belongs_to_running(path):
            continue
        try:
            found = FolderEntry(path, entry.stat(follow_symlinks=False).st_mode)
        except FileNotFoundError:  # removed meanwhile
            continue
        yield found
        if found.is_folder and found.is_kept:
            yield from entries_of(data, f"{path}/")
