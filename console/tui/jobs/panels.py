"""Panels of the page Jobs: the list, the selected job, and what to press next."""

from __future__ import annotations

from dataclasses import dataclass

from console.session.station.state import StationState
from console.tui.jobs.entry import Typing
from console.tui.jobs.refusals import OPENS
from console.tui.jobs.shelf import Shelf
from console.tui.lines import BLANK, Sheet, clipped, name_in, wrapped
from console.tui.pages.jobs_lines import JobList, hidden_words, summary_lines, table_lines
from console.tui.ui_context import UiContext, locked
from profiles.files import printable
from profiles.store import LoadedJob


@dataclass(frozen=True, slots=True, kw_only=True)
class Listed:
    """What is listed: jobs on their shelf or, with `importing`, files; and what is typed beside them."""

    shelf: Shelf
    importing: bool
    typing: Typing
    simulated: bool


class JobsPanels:
    """The table of jobs and the summary of the selected one; painted where something has changed."""

    def __init__(self, ui: UiContext) -> None:
        self._ui = ui
        self.table = Sheet(ui.palette, classes="table")
        self.summary = Sheet(ui.palette, classes="summary")
        self._shown: object = None

    def forget(self) -> None:
        """Paint again at the next time, whatever has changed."""
        self._shown = None

    def jobs(self, listed: Listed) -> JobList:
        """Return the list as its lines take it."""
        shelf, work = listed.shelf, self._ui.work
        return JobList(
            entries=shelf.entries,
            selected=shelf.selected,
            load=shelf.load,
            results=shelf.results,
            simulated=listed.simulated,
            open_path=None if work is None else work.loaded.path,
        )

    def paint(self, listed: Listed) -> None:
        """Paint both panels."""
        work, shelf, title = self._ui.work, listed.shelf, self._title(listed)
        sizes = self.table.size, self.summary.size
        opened_now = None if work is None else (work.loaded.path, work.edited)
        reading = self._ui.text("jobs_page.reading") if shelf.is_reading else ""
        shown = (shelf.entries, shelf.selected, title, reading, listed.typing, opened_now, sizes)
        if shown == self._shown:
            return
        self._shown, jobs, entry, text = shown, self.jobs(listed), shelf.entry, self._ui.text
        edited = work is not None and entry is not None and work.edited and work.loaded.path == entry.path
        size, hidden = self.summary.size, reading or hidden_words(jobs, text, self.table.size.height)
        rows = table_lines(jobs, text, *self.table.size)
        if not jobs.entries and (listed.importing or shelf.words):
            rows = wrapped(text("jobs_page.no_imports" if listed.importing else "jobs_page.no_match"), size.width)
        if listed.typing is not Typing.NOTHING:
            rows = [BLANK, *(rows[1:] if jobs.entries else rows)]
        self.table.show(rows, name_in(title, max(self.table.size.width - 4, 1), tail_fraction=0.5), hidden)
        rows = summary_lines(jobs, text, *size, edited=edited)
        if entry is not None and not isinstance(shelf.load(entry), LoadedJob):  # it cannot be used
            rows = clipped(rows, size.height, text("panel.more"))
        self.summary.show(rows, name_in(printable(entry.name), size.width - 4) if entry else "")

    def _title(self, listed: Listed) -> str:
        text, shelf = self._ui.text, listed.shelf
        if listed.importing:
            return text("jobs_page.imports", count=len(shelf.all))
        title = text("jobs_page.title", count=len(shelf.all))
        if shelf.words:
            title = text("jobs_page.title_found", count=len(shelf.entries), all=len(shelf.all))
        words = f"/{printable(shelf.words)}" if shelf.words else ""
        return " · ".join(filter(None, (title, words, text(f"jobs_page.sorted.{shelf.order}"))))

    def next_words(self, listed: Listed, state: StationState) -> str:
        """Return how to open the selected job, or why it cannot be."""
        text, entry, typing = self._ui.text, listed.shelf.entry, listed.typing
        refused = locked(state, *OPENS)
        if typing is not Typing.NOTHING:
            return text(f"jobs_page.next.{typing}")
        if listed.importing:
            return text("jobs_page.next.import" if entry else "jobs_page.next.import_none")
        if refused is not None:
            return text("jobs_page.next.moving") if state.moving else text("jobs_page.next.armed")
        if entry is None:
            return text("jobs_page.next.no_match" if listed.shelf.words else "jobs_page.next.none")
        if not isinstance(listed.shelf.load(entry), LoadedJob):
            return text("jobs_page.next.unreadable")
        return text("jobs_page.next.open", name=printable(entry.name))
