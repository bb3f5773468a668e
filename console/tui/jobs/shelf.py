"""The jobs as they are listed: which, in what order, and which of them is selected."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from console.session.data.history import LastResults
from console.session.data.kept_files import jobs_folder, require_open
from console.tui.jobs.index import JobIndex, Order
from console.tui.pages.jobs_lines import Loaded
from console.tui.ui_context import UiContext
from profiles.problem import ProfileError
from profiles.store import LibraryEntry, list_jobs, load_job


def listed_jobs(ui: UiContext) -> tuple[LibraryEntry, ...]:
    """Return all jobs; the answer says that the own ones are left out where their folder is closed."""
    folder = jobs_folder(ui.data)
    with ui.answering():
        require_open(folder)
    return list_jobs(folder)


class Shelf:
    """A list with a selection that stays on its file. Of a long list, only the visible part is loaded."""

    def __init__(self) -> None:
        self.all: tuple[LibraryEntry, ...] = ()
        self.entries: Sequence[LibraryEntry] = ()
        self.selected = 0
        self.words = ""
        self.order = Order.NAME
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
        return (bool(self.words) or self.order is not Order.NAME) and self.index.lacks(self.all)

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
        found = self.index.found(self.all, self.words) if self.words else self.all
        self.entries = self.index.sorted(found, self.order, self.results)
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
        orders = tuple(Order)
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
        return load_job(str(entry.path))
    except ProfileError as error:
        return tuple(error.problems)
