"""What all jobs are searched and sorted by: read once, beside the screen, and again where a file has changed."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from console.session.data.history import LastResults
from console.tui.records.beside import Beside
from profiles.fields import flatten
from profiles.files import read_toml
from profiles.problem import ProfileError
from profiles.store import LibraryEntry

PIECE = 50  # files read in one go: some 70 ms; between two pieces the machine may have begun to move


class Order(StrEnum):
    """What the jobs are sorted by, in the order in which a key steps through them."""

    NAME = "name"
    CHANGE = "change"
    RESULT = "result"
    MATERIAL = "material"


@dataclass(frozen=True, slots=True, kw_only=True)
class Indexed:
    """A file when it was read: its change (ns) and size, name and material of the job, and the words in it.

    A file that cannot be read has no words.
    """

    changed: tuple[int, int] = (0, 0)
    title: str = ""
    material: str = ""
    words: str = ""


_UNKNOWN = Indexed()


class JobIndex:
    """The index; only the thread of the screen changes it. `version` grows whenever it does."""

    def __init__(self) -> None:
        self._known: dict[Path, Indexed] = {}
        self._checked: set[Path] = set()
        self._pieces: Beside[dict[Path, Indexed]] = Beside(waits=False)
        self._visit = 0
        self.version = 0

    def begin(self) -> None:
        """Look at every file again; one that has not changed is not read again."""
        self._checked.clear()
        self._visit += 1

    def forget(self, path: Path) -> None:
        """Look at this file again."""
        self._checked.discard(path)
        self._visit += 1

    def lacks(self, entries: Sequence[LibraryEntry]) -> bool:
        """Whether files have not been looked at yet."""
        return any(entry.path not in self._checked for entry in entries)

    def read_on(self, entries: Sequence[LibraryEntry]) -> None:
        """Take the piece that was read, and ask for the next one; called at each tick."""
        paths = [entry.path for entry in entries if entry.path not in self._checked][:PIECE]
        if not paths:
            return
        known = {path: self._known[path] for path in paths if path in self._known}
        found = self._pieces.answer((self._visit, tuple(paths)), lambda: read_piece(paths, known))
        if found is None:
            return
        if isinstance(found, dict):
            self._known.update(found)
        self._checked.update(paths)
        self.version += 1

    def of(self, entry: LibraryEntry) -> Indexed:
        """Return what is known of a job."""
        return self._known.get(entry.path, _UNKNOWN)

    def found(self, entries: Iterable[LibraryEntry], typed: str) -> list[LibraryEntry]:
        """Return the jobs with every one of these words in name, material or tags."""
        words = typed.casefold().split()
        return [each for each in entries if all(word in self._text(each) for word in words)]

    def sorted(
        self, entries: Sequence[LibraryEntry], order: Order, results: LastResults
    ) -> Sequence[LibraryEntry]:
        """Return the jobs in this order; equal ones, and what is not known, stay in the order of their names."""
        if order is Order.CHANGE:
            return sorted(entries, key=lambda each: -self.of(each).changed[0])
        if order is Order.MATERIAL:
            return sorted(
                entries, key=lambda each: (not self.of(each).material, self.of(each).material.casefold())
            )
        if order is Order.RESULT:
            times = {name: last.measured_at.timestamp() for name, last in results.items()}
            return sorted(entries, key=lambda each: -times.get(self.of(each).title or each.name, 0.0))
        return entries

    def _text(self, entry: LibraryEntry) -> str:
        return f"{entry.name.casefold()} {self.of(entry).words}"


def read_piece(paths: Sequence[Path], known: dict[Path, Indexed]) -> dict[Path, Indexed]:
    """Return what is in these files; what is `known` of one that has not changed stays."""
    return {path: _read(path, known.get(path)) for path in paths}


def _read(path: Path, known: Indexed | None) -> Indexed:
    try:
        status = os.stat(path)
    except OSError:
        return _UNKNOWN
    changed = status.st_mtime_ns, status.st_size
    if known is not None and known.changed == changed:
        return known
    try:
        leaves, _ = flatten(read_toml(path)[1], where="")
    except ProfileError:
        return Indexed(changed=changed)
    title, material, tags = (leaves.get(key) for key in ("name", "material", "tags"))
    texts = [each for each in (title, material) if isinstance(each, str)]
    texts += [each for each in tags if isinstance(each, str)] if isinstance(tags, list) else []
    return Indexed(
        changed=changed,
        title=title if isinstance(title, str) else "",
        material=material if isinstance(material, str) else "",
        words=" ".join(texts).casefold(),
    )
