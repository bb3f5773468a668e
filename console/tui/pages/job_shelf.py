"""The jobs as they are listed: which, in what order, and which of them is selected."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from console.session.data.history import LastResults
from console.session.data.kept_files import jobs_folder, require_open
from console.tui.pages.jobs_lines import Loaded
from console.tui.records.background_reader import BackgroundReader
from console.tui.ui_context import UiContext
from profiles.fields import flatten
from profiles.files import read_toml
from profiles.problem import ProfileError
from profiles.store import LibraryEntry, list_jobs, load_job

PIECE = 50  # files read in one go: some 70 ms; between two pieces the machine may have begun to move


def listed_jobs(ui: UiContext) -> tuple[LibraryEntry, ...]:
    """Return all jobs; the answer says that the own ones are left out where their folder is closed."""
    folder = jobs_folder(ui.data)
    with ui.answering():
        require_open(folder)
    return list_jobs(folder)


class SortOrder(StrEnum):
    """What the jobs are sorted by, in the order in which a key steps through them."""

    NAME = "name"
    CHANGE = "change"
    RESULT = "result"
    MATERIAL = "material"


@dataclass(frozen=True, slots=True, kw_only=True)
class IndexedJob:
    """A file when it was read: its change (ns) and size, name and material of the job, and the words in it.

    A file that cannot be read has no words.
    """

    changed: tuple[int, int] = (0, 0)
    title: str = ""
    material: str = ""
    words: str = ""


_UNKNOWN = IndexedJob()


class JobIndex:
    """The index; only the thread of the screen changes it. `version` grows whenever it does."""

    def __init__(self) -> None:
        self._known: dict[Path, IndexedJob] = {}
        self._checked: set[Path] = set()
        self._pieces: BackgroundReader[dict[Path, IndexedJob]] = BackgroundReader(waits=False)
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
        found = self._pieces.answer(
            (self._visit, tuple(paths)), lambda: {path: _read(path, known.get(path)) for path in paths}
        )
        if found is None:
            return
        if isinstance(found, dict):
            self._known.update(found)
        self._checked.update(paths)
        self.version += 1

    def index_job(self, entry: LibraryEntry) -> IndexedJob:
        """Return what is known of a job."""
        return self._known.get(entry.path, _UNKNOWN)

    def find_jobs(self, entries: Iterable[LibraryEntry], typed: str) -> list[LibraryEntry]:
        """Return the jobs with every one of these words in name, material or tags."""
        words = typed.casefold().split()
        return [each for each in entries if all(word in self._text(each) for word in words)]

    def sort_jobs(
        self, entries: Sequence[LibraryEntry], order: SortOrder, results: LastResults
    ) -> Sequence[LibraryEntry]:
        """Return the jobs in this order; equal ones, and what is not known, stay in the order of their names."""
        if order is SortOrder.CHANGE:
            return sorted(entries, key=lambda each: -self.index_job(each).changed[0])
        if order is SortOrder.MATERIAL:
            return sorted(
                entries,
                key=lambda each: (not self.index_job(each).material, self.index_job(each).material.casefold()),
            )
        if order is SortOrder.RESULT:
            times = {name: last.measured_at.timestamp() for name, last in results.items()}
            return sorted(entries, key=lambda each: -times.get(self.index_job(each).title or each.name, 0.0))
        return entries

    def _text(self, entry: LibraryEntry) -> str:
        return f"{entry.name.casefold()} {self.index_job(entry).words}"


def _read(path: Path, known: IndexedJob | None) -> IndexedJob:
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
        return IndexedJob(changed=changed)
    title, material, tags = (leaves.get(key) for key in ("name", "material", "tags"))
    texts = [each for each in (title, material) if isinstance(each, str)]
    texts += [each for each in tags if isinstance(each, str)] if isinstance(tags, list) else []
    return IndexedJob(
        changed=changed,
        title=title if isinstance(title, str) else "",
        material=material if isinstance(material, str) else "",
        words=" ".join(texts).casefold(),
    )


class Shelf:
    """A list with a selection that stays on its file. Of a long list, only the visible part is loaded."""

    def __init__(self) -> None:
        self.all: tuple[LibraryEntry, ...] = ()
        self.entries: Sequence[LibraryEntry] = ()
        self.selected = 0
        self.words = ""
        self.order = SortOrder.NAME
        self.index = JobIndex()
        self.results: LastResults = {}
        self._loaded: dict[Path, Loaded] = {}
        self._arranged: object = None

    @property
    def entry(self) -> LibraryEntry | None:
        """The selected one, None where nothing is listed."""
        return self.entries[self.selected] if self.entries else None

    @property
    def is_reading(self) -> bool:
        """Whether the index is needed and not complete."""
        return (bool(self.words) or self.order is not SortOrder.NAME) and self.index.lacks(self.all)

    def fill(self, entries: tuple[LibraryEntry, ...], results: LastResults, target: Path | None) -> None:
        """List these files, with the selection on `target` where that is one of them."""
        self.all, self.results = entries, results
        self._loaded.clear()
        self.index.begin()
        self._arranged = None
        self.arrange(target)

    def arrange(self, target: Path | None = None) -> None:
        """Search and sort where anything has changed; the selection stays on its file, or near it."""
        wanted = (id(self.all), self.words, self.order, self.index.version)
        if wanted == self._arranged:
            return
        self._arranged = wanted
        kept = target or (None if self.entry is None else self.entry.path)
        found = self.index.find_jobs(self.all, self.words) if self.words else self.all
        self.entries = self.index.sort_jobs(found, self.order, self.results)
        self.select(kept)

    def select(self, path: Path | None) -> None:
        """Select a file; where it is not listed the selection stays in its place."""
        place = next((n for n, each in enumerate(self.entries) if each.path == path), self.selected)
        self.selected = max(min(place, len(self.entries) - 1), 0)

    def move(self, by: int) -> None:
        """Move the selection, to the end of the list at most."""
        self.selected = max(min(self.selected + by, len(self.entries) - 1), 0)

    def search(self, words: str) -> None:
        """List what has these words; the first of them is selected."""
        if words != self.words:
            self.words = words
            self.arrange()
            self.selected = 0 if words else self.selected

    def step_order(self) -> None:
        """Sort by the next thing."""
        orders = tuple(SortOrder)
        self.order = orders[(orders.index(self.order) + 1) % len(orders)]
        self.arrange()

    def load(self, entry: LibraryEntry) -> Loaded:
        """Read a job once."""
        if entry.path not in self._loaded:
            self._loaded[entry.path] = loaded_or_why(entry)
        return self._loaded[entry.path]


def loaded_or_why(entry: LibraryEntry) -> Loaded:
    """Return a job, or why its file cannot be used."""
    try:
        return load_job(entry)
    except ProfileError as error:
        return tuple(error.problems)
