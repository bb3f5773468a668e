"""What differs in a data folder from its commit, and how that stands to the upstream as last fetched."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from console.session.data.version_control import answer, commit_of, is_clone
from console.session.errors import SessionError
from profiles.files import printable, read_regular_file
from profiles.problem import Problem, ProfileError

FOLDERS = ("jobs", "machines", "learned", "calibrations", "identified", "health", "trials", "stops")
"""Folders whose files say how parts are cut."""

UPSTREAM = "@{upstream}"
CONFLICT_TAG, SPARSE_TAG = "M", "S"  # of `git ls-files -t`
LINK_MODE, SHA1_DIGITS = "120000", 40
CAP_BYTES = 100_000_000  # far above what is read of any of these files


class FileChangeKind(StrEnum):
    """How a file differs from the commit."""

    MODIFIED = "modified"
    NEW = "new"
    DELETED = "deleted"
    CONFLICT = "conflict"


@dataclass(frozen=True, slots=True, kw_only=True)
class FileChange:
    """A file that differs; `path` is below the data folder."""

    path: str
    how: FileChangeKind


@dataclass(frozen=True, slots=True, kw_only=True)
class CloneStatus:
    """A clone: `commit` is None before the first, `branch` where none is checked out.

    `ahead` and `behind` count commits against `upstream` as it was last fetched; None where none is known.
    """

    commit: str | None
    branch: str | None
    upstream: str | None
    ahead: int | None
    behind: int | None
    changes: tuple[FileChange, ...]


def clone_status(data: Path) -> CloneStatus:
    """Return how a data folder differs from its commit.

    Raises SessionError: `git.no_clone`; as `answer`; `git.refused`.
    """
    where = printable(str(data))
    if not is_clone(data):
        raise SessionError(Problem(code="git.no_clone", where=where))
    commit = commit_of(data)
    branch, upstream = (
        _line(answer(data, *words))
        for words in (
            ("symbolic-ref", "--quiet", "--short", "HEAD"),
            ("rev-parse", "--abbrev-ref", "--verify", "--quiet", UPSTREAM),
        )
    )
    counts = (_line(answer(data, "rev-list", "--count", "--left-right", f"HEAD...{UPSTREAM}")) or "").split()
    there = answer(data, "ls-files", "-t", "-z", "--cached", "--others", "--exclude-standard", "--", *FOLDERS)
    committed = b"" if commit is None else answer(data, "ls-tree", "-r", "-z", "--full-tree", commit, *FOLDERS)
    if there is None or committed is None:
        raise SessionError(Problem(code="git.refused", where=where, value="git ls-files"))
    return CloneStatus(
        commit=commit,
        branch=branch,
        upstream=upstream,
        ahead=int(counts[0]) if counts else None,
        behind=int(counts[1]) if counts else None,
        changes=tuple(_changes(data, _entries(there, " "), _entries(committed, "\t"))),
    )


def _line(found: bytes | None) -> str | None:
    return None if found is None else os.fsdecode(found).strip()


def _entries(found: bytes, end: str) -> dict[str, str]:
    """Return what git says of each path, by path."""
    parts = (os.fsdecode(entry).partition(end) for entry in found.split(b"\0") if entry)
    return {path: said for said, _, path in parts}


def _changes(data: Path, there: Mapping[str, str], committed: Mapping[str, str]) -> Iterator[FileChange]:
    """Yield what differs; `there` has the tags of `git ls-files -t`, `committed` mode, type and hash."""
    for path in sorted({*there, *committed}):
        mode, _, blob = committed.get(path, " ").partition(" ")
        kind, _, digest = blob.partition(" ")
        is_there = os.path.lexists(data / path)
        if there.get(path) == CONFLICT_TAG:
            yield FileChange(path=path, how=FileChangeKind.CONFLICT)
        elif path not in committed:
            if is_there:
                yield FileChange(path=path, how=FileChangeKind.NEW)
        elif not is_there:
            if there.get(path) != SPARSE_TAG:
                yield FileChange(path=path, how=FileChangeKind.DELETED)
        elif kind == "blob" and not _is_blob(data / path, mode == LINK_MODE, digest):
            yield FileChange(path=path, how=FileChangeKind.MODIFIED)


def _is_blob(path: Path, is_link: bool, digest: str) -> bool:
    """Whether a file has the bytes of a blob, unconverted: git itself would run the filters of the folder."""
    try:
        content = os.fsencode(os.readlink(path)) if is_link else read_regular_file(path, cap_bytes=CAP_BYTES)
    except (OSError, ProfileError):  # closed, or not what was committed
        return False
    kind = hashlib.sha1 if len(digest) == SHA1_DIGITS else hashlib.sha256
    found = kind(b"blob %d\0" % len(content) + content, usedforsecurity=False).hexdigest()
    return path.is_symlink() == is_link and found == digest
