"""What differs in a data folder from its commit, and how that stands to the upstream as last fetched."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from console.session.errors import SessionError
from console.session.versioning.git import answer, is_clone
from profiles.files import printable
from profiles.problem import Problem

FOLDERS = ("jobs", "machines", "learned", "calibrations", "identified", "health", "trials", "stops")
"""Folders whose files say how parts are cut."""


class How(StrEnum):
    """How a file differs from the commit."""

    MODIFIED = "modified"
    NEW = "new"
    DELETED = "deleted"
    CONFLICT = "conflict"


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A file that differs; `path` is below the data folder."""

    path: str
    how: How


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
    changes: tuple[Change, ...]


def clone_status(data: Path) -> CloneStatus:
    """Return how a data folder differs from its commit.

    Raises SessionError: `git.no_clone`; as `answer`; `git.refused`.
    """
    where = printable(str(data))
    if not is_clone(data):
        raise SessionError(Problem(code="git.no_clone", where=where))
    words = ("status", "--porcelain=v2", "--branch", "-z", "--untracked-files=all", "--ignore-submodules=all")
    found = answer(data, *words, "--no-renames", "--", *FOLDERS)
    if found is None:
        raise SessionError(Problem(code="git.refused", where=where, value="git status"))
    lines = [os.fsdecode(line) for line in found.split(b"\0") if line]
    head = dict(line[2:].split(" ", 1) for line in lines if line.startswith("# ") and " " in line[2:])
    ahead, behind = _counts(head.get("branch.ab"))
    commit, branch = head.get("branch.oid"), head.get("branch.head")
    return CloneStatus(
        commit=None if commit in (None, "(initial)") else commit,
        branch=None if branch in (None, "(detached)") else branch,
        upstream=head.get("branch.upstream"),
        ahead=ahead,
        behind=behind,
        changes=tuple(sorted(_changes(lines), key=lambda change: change.path)),
    )


def _counts(found: str | None) -> tuple[int | None, int | None]:
    """Return commits ahead and behind, as in "+1 -2"."""
    if found is None:
        return None, None
    ahead, behind = found.split(" ")
    return int(ahead), -int(behind)


def _changes(lines: list[str]) -> Iterator[Change]:
    for line in lines:
        match line[:2]:
            case "1 ":
                _, both, *_, path = line.split(" ", 8)
                yield Change(path=path, how=_how(both))
            case "u ":
                yield Change(path=line.split(" ", 10)[-1], how=How.CONFLICT)
            case "? ":
                yield Change(path=line[2:], how=How.NEW)


def _how(both: str) -> How:
    """Return how a file differs, by its letters in the index and in the folder."""
    if both[1] == "D" or both == "D.":
        return How.DELETED
    return How.NEW if both[0] == "A" else How.MODIFIED
