"""Page Jobs: find, open and keep the saved jobs. The first page, painted before anything heavy is loaded."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from textual.widget import Widget
from textual.widgets import Input

from console.session.data.history import last_results
from console.session.data.kept_files import jobs_folder, newest_files
from console.session.job_files import import_folder
from console.session.station.state import StationState
from console.session.work import Work, blank_form, differs, open_work
from console.tui.application.scans import find_job
from console.tui.entry import PATH_CAP_CHARACTERS, EntryLine
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import BLANK, Line, Sheet, clip_lines, line, name_in, wrap_line
from console.tui.page import Page, rows_moved
from console.tui.pages import job_changes as changes
from console.tui.pages.job_shelf import Shelf, listed_jobs
from console.tui.pages.jobs_lines import JobList, hidden_words, summary_lines, table_lines, visible
from console.tui.theme import Token
from console.tui.ui_context import KEYS, UiContext, View, find_job_lock
from profiles.fields import TEXT_CAP_CHARACTERS
from profiles.files import printable
from profiles.job import Job
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry, LoadedJob, list_jobs, load_job

OPENS = "screen.open_moving", "screen.open_armed"
CHANGES = "screen.jobs_moving", "screen.jobs_armed"  # what is written to disk waits for rest
READS = ("jobs.open", "jobs.copy", "jobs.new", "jobs.search", "jobs.sort", "jobs.export")
"""Actions that change nothing on disk, but for the copy of an export."""

_OPENING = ("jobs.open", "jobs.copy", "jobs.new")
_OF_IMPORTS = ("jobs.open", "jobs.path", "jobs.back", "jobs.import")
_REFUSES: dict[str, Callable[[UiContext, LibraryEntry], None]] = {
    "jobs.rename": changes.rename_refused,
    "jobs.delete": changes.delete_refused,
    "jobs.note": lambda _, entry: changes.own_or_refused(entry),
    "jobs.tags": lambda _, entry: changes.own_or_refused(entry),
}


class JobEntry(StrEnum):
    """What is typed."""

    NOTHING = "nothing"
    SEARCH = "search"
    NAME = "name"
    NOTE = "note"
    TAGS = "tags"
    PATH = "path"


class JobsEntry(EntryLine):
    """One line of free text over the heading of the list."""

    DEFAULT_CSS = "JobsEntry { width: 50%; offset: 3 1; }"

    def __init__(self) -> None:
        super().__init__(id="jobs-entry")
        self.typing = JobEntry.NOTHING

    def open(self, typing: JobEntry, value: str) -> None:
        """Begin with this text; the words of a search are marked: an arrow key keeps them."""
        self.typing = typing
        self.max_length = PATH_CAP_CHARACTERS if typing is JobEntry.PATH else TEXT_CAP_CHARACTERS
        self.begin(value, marked=typing is JobEntry.SEARCH)

    def close(self) -> str:
        """End the entry, and return what was typed."""
        self.typing = JobEntry.NOTHING
        return super().close()


@dataclass(frozen=True, slots=True, kw_only=True)
class JobsContent:
    """What is listed: jobs on their shelf or, with `importing`, files; and what is typed beside them."""

    shelf: Shelf
    importing: bool
    typing: JobEntry
    simulated: bool


def refused_now(ui: UiContext, view: View, action: str, shelf: Shelf, *, importing: bool) -> tuple[Problem, ...]:
    """Return why an action can do nothing now, or nothing to the selected job; empty if it can."""
    moves = rows_moved(action) is not None
    if importing and not moves and action not in _OF_IMPORTS:
        return (Problem(code="screen.jobs_list_first"),)
    if action == "jobs.path" and not importing:
        return (Problem(code="screen.jobs_import_only"),)
    changing = not moves and action not in (*READS, "jobs.back")
    if action in _OPENING or changing:
        if refused := find_job_lock(view.state, *(OPENS if action in _OPENING else CHANGES)):
            return (refused,)
    entry = shelf.entry
    if entry is None or importing:
        return ()
    loaded = shelf.load(entry) if action in ("jobs.open", "jobs.copy") else None
    return loaded if isinstance(loaded, tuple) else _change_refused(ui, action, entry)


def _change_refused(ui: UiContext, action: str, entry: LibraryEntry) -> tuple[Problem, ...]:
    try:
        if refuses := _REFUSES.get(action):
            refuses(ui, entry)
    except ProfileError as error:
        return tuple(error.problems)
    return ()


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

    def jobs(self, listed: JobsContent) -> JobList:
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

    def paint(self, listed: JobsContent) -> None:
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
            rows = wrap_line(
                text("jobs_page.no_imports" if listed.importing else "jobs_page.no_match"), size.width
            )
        if listed.typing is not JobEntry.NOTHING:
            rows = [BLANK, *(rows[1:] if jobs.entries else rows)]
        self.table.show(rows, name_in(title, max(self.table.size.width - 4, 1), tail_fraction=0.5), hidden)
        rows = summary_lines(jobs, text, *size, edited=edited)
        if entry is not None and not isinstance(shelf.load(entry), LoadedJob):  # it cannot be used
            rows = clip_lines(rows, size.height, text("panel.more"))
        self.summary.show(rows, name_in(printable(entry.name), size.width - 4) if entry else "")

    def _title(self, listed: JobsContent) -> str:
        text, shelf = self._ui.text, listed.shelf
        if listed.importing:
            return text("jobs_page.imports", count=len(shelf.all))
        title = text("jobs_page.title", count=len(shelf.all))
        if shelf.words:
            title = text("jobs_page.title_found", count=len(shelf.entries), all=len(shelf.all))
        words = f"/{printable(shelf.words)}" if shelf.words else ""
        return " · ".join(filter(None, (title, words, text(f"jobs_page.sorted.{shelf.order}"))))

    def next_words(self, listed: JobsContent, state: StationState) -> str:
        """Return how to open the selected job, or why it cannot be."""
        text, entry, typing = self._ui.text, listed.shelf.entry, listed.typing
        refused = find_job_lock(state, *OPENS)
        if typing is not JobEntry.NOTHING:
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


_ENTRIES = {"jobs.rename": JobEntry.NAME, "jobs.note": JobEntry.NOTE, "jobs.tags": JobEntry.TAGS}


class JobsPage(Page):
    """The saved jobs, or files to import, and details of the selected one. Nothing on it moves anything."""

    name_ = PageName.JOBS
    SCOPED_CSS = False  # the size classes are set on the screen

    DEFAULT_CSS = """
    JobsPage {
        layout: horizontal;
        layers: base entry;
        Sheet { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
        .table { width: 58%; height: 1fr; }
        .summary { width: 1fr; height: 1fr; }
    }
    JobsPage.-wide .table { width: 69%; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._panels = JobsPanels(ui)
        self._entry = JobsEntry()
        self.panels = (self._panels.table, self._panels.summary, self._entry)
        self._jobs_shelf, self._imports = Shelf(), Shelf()
        self._importing = False
        self._fresh = False
        self._simulated = True
        self._warned: tuple[object, Job] | None = None
        self._doomed: Path | None = None

    def show(self, view: View) -> None:
        """Show the list; it is read when the page is shown after another one."""
        if not self._fresh or self._simulated != view.state.simulated:
            self._simulated = view.state.simulated
            self._read()
        jobs = self._jobs_shelf
        if jobs.is_reading or self._entry.typing is JobEntry.SEARCH:
            if not view.state.may_move:  # a thread that reads for seconds is for a machine at rest
                jobs.index.read_on(jobs.all)
            jobs.arrange()
        self._entry.keep_focus()
        self._panels.paint(self._jobs_content)

    def leave(self) -> None:
        """Discard the list, as files may have changed by the next time, and an entry that was not ended."""
        if self._entry.typing not in (JobEntry.NOTHING, JobEntry.SEARCH):
            self.ui.say("screen.job_entry_dropped")
        self._entry.close()
        self._fresh, self._importing, self._warned, self._doomed = False, False, None, None

    @property
    def field(self) -> FieldKind:
        """Free text while something is typed."""
        return FieldKind.NONE if self._entry.typing is JobEntry.NOTHING else FieldKind.TEXT

    def on_input_changed(self, event: Input.Changed) -> None:
        """Search at every keystroke."""
        if self._entry.typing is JobEntry.SEARCH:
            self._jobs_shelf.search(event.value.strip())
            self._panels.paint(self._jobs_content)

    def act(self, action: str) -> None:
        """Do what a key says; an open entry first gets the characters that came before."""
        if self._entry.typing is JobEntry.NOTHING:
            self._do(action)
        else:
            self._entry.call_later(self._end_entry if action == "jobs.open" else self._do_beside, action)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a key of this page can do nothing now, or nothing to the selected job."""
        return refused_now(self.ui, view, action, self._shelf, importing=self._importing)

    def next_step(self, view: View) -> Line:
        """Return how to open the selected job, or why it cannot be."""
        return line((self._panels.next_words(self._jobs_content, view.state), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return why the selected file cannot be used."""
        entry = self._shelf.entry
        if entry is None or isinstance(self._shelf.load(entry), LoadedJob):
            return []
        return summary_lines(self._panels.jobs(self._jobs_content), self.ui.text, width, edited=False)

    @property
    def _shelf(self) -> Shelf:
        """What is listed now."""
        return self._imports if self._importing else self._jobs_shelf

    @property
    def _jobs_content(self) -> JobsContent:
        return JobsContent(
            shelf=self._shelf, importing=self._importing, typing=self._entry.typing, simulated=self._simulated
        )

    def _do(self, action: str) -> None:
        moved = self._move(action)
        if action != "jobs.delete":
            self._doomed = None
        if moved:
            self._warned = None
        elif self._importing:
            self._do_importing(action)
        elif action in READS:
            self._do_reading(action)
        elif action == "jobs.back":
            self._jobs_shelf.search("")
        elif action == "jobs.path":
            self.ui.say("screen.jobs_import_only")
        elif refused := find_job_lock(self.ui.control.state, *CHANGES):
            self.ui.key_answer = (refused,)
        else:
            with self.ui.answering():
                self._change(action)
        self._panels.paint(self._jobs_content)

    def _do_beside(self, action: str) -> None:
        """Do what is possible during an entry: move the selection in what a search has found."""
        if self._entry.typing is JobEntry.SEARCH:
            self._move(action)
            self._panels.paint(self._jobs_content)

    def point(self, panel: Widget, row: int) -> None:
        """Choose the job in a row that was clicked, below the heading."""
        seen = visible(self._panels.jobs(self._jobs_content), self._panels.table.size.height)
        if panel is self._panels.table and 0 < row <= len(seen):
            self._shelf.move(seen[row - 1] - self._shelf.selected)

    def _move(self, action: str) -> bool:
        page = max(len(visible(self._panels.jobs(self._jobs_content), self._panels.table.size.height)) - 1, 1)
        by = rows_moved(action, page)
        self._shelf.move(by or 0)
        return by is not None

    def _do_reading(self, action: str) -> None:
        if action in ("jobs.open", "jobs.copy"):
            self._open(copying=action == "jobs.copy")
        elif action == "jobs.new":
            self._begin()
        elif action == "jobs.search":
            self._entry.open(JobEntry.SEARCH, self._jobs_shelf.words)
        elif action == "jobs.sort":
            self._jobs_shelf.step_order()
        elif (entry := self._shelf.entry) is not None:
            with self.ui.answering():
                changes.copy_job_out(self.ui, entry)

    def _change(self, action: str) -> None:
        entry = self._shelf.entry
        if action == "jobs.import":
            self._list_imports()
        elif action == "jobs.undo":
            if path := changes.brought_back(self.ui, self._names(own=True)):
                self._read(path)
        elif entry is not None and action == "jobs.delete":
            self._delete(entry)
        elif entry is not None and (typing := _ENTRIES.get(action, JobEntry.NOTHING)) is not JobEntry.NOTHING:
            self._begin_entry(typing, entry)

    def _do_importing(self, action: str) -> None:
        """Take the selected file, type the path of another one, or go back to the jobs."""
        if action in ("jobs.back", "jobs.import"):
            self._importing = False
            self._panels.forget()
        elif action == "jobs.path":
            self._entry.open(JobEntry.PATH, "")
        elif action == "jobs.open":
            entry = self._shelf.entry
            if entry is not None:
                self._import(entry.path)
        else:
            self.ui.say("screen.jobs_list_first")

    def _list_imports(self) -> None:
        files = newest_files(import_folder(self.ui.data), ".toml")
        entries = tuple(LibraryEntry(name=path.stem, path=path, bundled=False) for path in files)
        self._imports.fill(entries, {}, None)
        self._importing = True
        self._panels.forget()

    def _import(self, source: Path) -> None:
        if refused := find_job_lock(self.ui.control.state, *CHANGES):
            self.ui.key_answer = (refused,)
            return
        with self.ui.answering():
            path = changes.import_job_file(self.ui, source, self._names())
            self._importing = False
            self._read(path)

    def _delete(self, entry: LibraryEntry) -> None:
        """Delete a job on the second press in a row."""
        changes.delete_refused(self.ui, entry)
        if self._doomed != entry.path:
            self._doomed = entry.path
            self.ui.say("screen.job_delete_again", key=KEYS["jobs.delete"], value=printable(entry.name))
            return
        self._doomed = None
        changes.remove_job(self.ui, entry)
        self._read()

    def _begin_entry(self, typing: JobEntry, entry: LibraryEntry) -> None:
        changes.own_or_refused(entry)
        if typing is JobEntry.NAME:
            changes.rename_refused(self.ui, entry)
        job = load_job(str(entry.path)).job
        self._entry.open(
            typing, {JobEntry.NAME: entry.name, JobEntry.NOTE: job.note}.get(typing, " ".join(job.tags))
        )

    def _end_entry(self, _: str) -> None:
        """Take what was typed; what is refused stays to be corrected."""
        typing, entry, typed = self._entry.typing, self._shelf.entry, self._entry.value.strip()
        if typing is JobEntry.SEARCH:
            self._jobs_shelf.search(typed)
            self._entry.close()
            if typed and len(self._shelf.entries) == 1:
                self._open(copying=False)
        elif refused := find_job_lock(self.ui.control.state, *CHANGES):
            self.ui.key_answer = (refused,)
        else:
            with self.ui.answering():
                self._take_entry(typing, entry, typed)
        self._panels.paint(self._jobs_content)

    def _take_entry(self, typing: JobEntry, entry: LibraryEntry | None, typed: str) -> None:
        path = None if entry is None else entry.path
        if typing is JobEntry.PATH:
            self._entry.close()
            if typed:
                self._import(import_folder(self.ui.data) / os.path.expanduser(typed))
            return
        if entry is not None and typing is JobEntry.NOTE:
            changes.label_job(self.ui, entry, note=typed)
        elif entry is not None and typing is JobEntry.TAGS:
            changes.label_job(self.ui, entry, tags=typed)
        elif entry is not None and typed not in ("", entry.name):
            path = changes.rename_job_file(self.ui, entry, typed, self._names())
        self._entry.close()
        self._read(path)

    def _names(self, *, own: bool = False) -> frozenset[str]:
        """Return the names of all jobs as they are now, or of the own ones."""
        listed = list_jobs(jobs_folder(self.ui.data))
        return frozenset(each.name for each in listed if not (own and each.bundled))

    def _read(self, target: Path | None = None) -> None:
        """List the files again; the selection stays on its job, at first the open one."""
        shelf, work = self._jobs_shelf, self.ui.work
        if target is None and shelf.entry is not None:
            target = shelf.entry.path
        elif target is None and work is not None:
            target = work.loaded.path
        results = last_results(self.ui.data, simulated=self._simulated)
        listed = listed_jobs(self.ui)
        self.ui.jobs = tuple(printable(each.name) for each in listed)
        shelf.fill(listed, results, target)
        self._fresh = True
        self._panels.forget()

    def _open(self, *, copying: bool) -> None:
        refused, entry = find_job_lock(self.ui.control.state, *OPENS), self._shelf.entry
        if refused is not None:
            self.ui.key_answer = (refused,)
        elif entry is not None:
            with self.ui.answering():
                self._take(load_job(entry), copying=copying)

    def open_named(self, name: str) -> None:
        """Open the job of a scanned code, from whatever page, where Enter would open it here."""
        if refused := find_job_lock(self.ui.control.state, *OPENS):
            self.ui.key_answer = (refused,)
        elif isinstance(entry := find_job(list_jobs(jobs_folder(self.ui.data)), name), Problem):
            self.ui.key_answer = (entry,)
        else:
            with self.ui.answering():
                self._take(load_job(entry), copying=False)

    def _begin(self) -> None:
        """Begin a new job on a blank form, or continue the one that was begun."""
        if refused := find_job_lock(self.ui.control.state, *OPENS):
            self.ui.key_answer = (refused,)
            return
        if self.ui.draft is None:
            if self._loses("new", self.ui.work):
                return
            self.ui.work, self.ui.draft = None, blank_form(self.ui.machine)
        self.ui.go(PageName.SETUP)

    def _loses(self, target: object, held: Work | None) -> bool:
        """Whether something not saved would be lost; it is reported, and discarded by the same key once more."""
        if held is None or not held.edited or self._warned == (target, held.job):
            return False
        self._warned = (target, held.job)
        self.ui.say("screen.edits_unsaved", value=printable(held.job.name) or self.ui.text("setup.new_title"))
        return True

    def _take(self, loaded: LoadedJob, *, copying: bool) -> None:
        """Open a job, for `copying` with the question for a name. The open one keeps its edits."""
        work = self.ui.work
        kept = work is not None and work.loaded.path == loaded.path
        if not kept and self._loses((loaded.path, copying), self.ui.draft or work):
            return
        if work is None or not kept or (not work.edited and differs(loaded, work.loaded)):
            # Loads numerics, which the first page does without.
            from console.session.cut.compensated_cut import with_accepted

            work, state = open_work(loaded, self.ui.machine), self.ui.control.state
            self.ui.work = with_accepted(work, self.ui.data, simulated=state.simulated, lathe=state.lathe)
            self.ui.key_answer = self.ui.work.set_aside
        self.ui.draft, self.ui.copying = None, copying
        self.ui.go(PageName.SETUP)
