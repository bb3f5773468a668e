"""Page Jobs: pick a saved job. It is the first page, and is painted before anything heavy is loaded."""

from __future__ import annotations

from console.session.data.history import LastResults, last_results
from console.session.data.kept_files import jobs_folder
from console.session.station.state import StationState
from console.session.work import Work, blank_form, opened
from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, clipped, line, name_in
from console.tui.page import Page
from console.tui.pages.jobs_lines import JobList, Loaded, hidden_words, summary_lines, table_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View, locked
from profiles.files import printable
from profiles.job import Job
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry, LoadedJob, list_jobs, load_job

_LOCKED = "screen.open_moving", "screen.open_armed"


class JobsPage(Page):
    """The saved jobs, and details of the selected one."""

    name_ = PageName.JOBS
    SCOPED_CSS = False  # the size classes are set on the screen

    DEFAULT_CSS = """
    JobsPage {
        layout: horizontal;
        Sheet { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
        .table { width: 58%; height: 1fr; }
        .summary { width: 1fr; height: 1fr; }
    }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._table = Sheet(ui.palette, classes="table")
        self._summary = Sheet(ui.palette, classes="summary")
        self.panels = (self._table, self._summary)
        self._entries: tuple[LibraryEntry, ...] = ()
        self._fresh = False
        self._selected = 0
        self._loaded: dict[str, Loaded] = {}
        self._results: LastResults = {}
        self._simulated = True
        self._warned: tuple[object, Job] | None = None
        self._shown: object = None

    def show(self, view: View) -> None:
        """Show the list; it is read when the page is shown after another one."""
        if not self._fresh or self._simulated != view.state.simulated:
            self._simulated = view.state.simulated
            self._read()
        self._paint()

    def leave(self) -> None:
        """Discard the list: files may have changed by the next time."""
        self._fresh, self._warned = False, None

    def act(self, action: str) -> None:
        """Move the selection, open the selected job or a copy of it, or begin a new one."""
        if action in ("jobs.open", "jobs.copy"):
            self._open(copying=action == "jobs.copy")
        elif action == "jobs.new":
            self._begin()
        else:
            self._warned = None
            last = len(self._entries) - 1
            self._selected = max(min(self._selected + (1 if action == "jobs.down" else -1), last), 0)
        self._paint()

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why no job can be opened, copied or begun now, or why the selected one cannot be."""
        if action not in ("jobs.open", "jobs.copy", "jobs.new"):
            return ()
        if refused := locked(view.state, *_LOCKED):
            return (refused,)
        entry = self._jobs.entry
        loaded = None if entry is None or action == "jobs.new" else self._load(entry)
        return loaded if isinstance(loaded, tuple) else ()

    def next_step(self, view: View) -> Line:
        """Return how to open the selected job, or why it cannot be."""
        return line((self._next_words(view.state), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return why the selected file cannot be used."""
        entry = self._jobs.entry
        if entry is None or isinstance(self._load(entry), LoadedJob):
            return []
        return summary_lines(self._jobs, self.ui.text, width, edited=False)

    def _read(self) -> None:
        """List the files again; the selection stays on its job, at first the open one."""
        before = self._jobs.entry
        target = before.path if before else self.ui.work.loaded.path if self.ui.work else None
        self._entries = list_jobs(jobs_folder(self.ui.data))
        paths = [entry.path for entry in self._entries]
        place = paths.index(target) if target in paths else self._selected
        self._selected = max(min(place, len(paths) - 1), 0)
        self._fresh = True
        self._loaded.clear()
        self._results = last_results(self.ui.data, simulated=self._simulated)
        self._shown = None

    def _load(self, entry: LibraryEntry) -> Loaded:
        """Read a job once; of a long list, only the visible part is read."""
        if entry.name not in self._loaded:
            try:
                self._loaded[entry.name] = load_job(str(entry.path))
            except ProfileError as error:
                self._loaded[entry.name] = tuple(error.problems)
        return self._loaded[entry.name]

    def _open(self, *, copying: bool) -> None:
        refused, entry = locked(self.ui.control.state, *_LOCKED), self._jobs.entry
        if refused is not None:
            self.ui.said = (refused,)
        elif entry is not None:
            with self.ui.answering():
                self._take(load_job(str(entry.path)), copying=copying)

    def _begin(self) -> None:
        """Begin a new job on a blank form, or continue the one that was begun."""
        if refused := locked(self.ui.control.state, *_LOCKED):
            self.ui.said = (refused,)
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
        if work is None or not kept or (not work.edited and work.loaded.sha256 != loaded.sha256):
            # Loads numerics, which the first page does without.
            from console.session.cut.compensated import with_accepted

            work, simulated = opened(loaded, self.ui.machine), self.ui.control.state.simulated
            self.ui.work = with_accepted(work, self.ui.data, simulated=simulated)
            self.ui.said = self.ui.work.set_aside
        self.ui.draft, self.ui.copying = None, copying
        self.ui.go(PageName.SETUP)

    @property
    def _jobs(self) -> JobList:
        return JobList(
            entries=self._entries,
            selected=self._selected,
            load=self._load,
            results=self._results,
            simulated=self._simulated,
        )

    def _paint(self) -> None:
        work = self.ui.work
        sizes = self._table.size, self._summary.size
        shown = (self._entries, self._selected, work is not None and work.edited, sizes)
        if shown == self._shown:
            return
        self._shown = shown
        jobs, entry, text = self._jobs, self._jobs.entry, self.ui.text
        edited = work is not None and entry is not None and work.edited and work.loaded.path == entry.path
        size, hidden = self._summary.size, hidden_words(jobs, text, self._table.size.height)
        rows = table_lines(jobs, text, *self._table.size)
        self._table.show(rows, text("jobs_page.title", count=len(jobs.entries)), hidden)
        rows = summary_lines(jobs, text, size.width, edited=edited)
        if entry is not None and not isinstance(self._load(entry), LoadedJob):  # it cannot be used
            rows = clipped(rows, size.height, text("panel.more"))
        self._summary.show(rows, name_in(printable(entry.name), size.width - 4) if entry else "")

    def _next_words(self, state: StationState) -> str:
        text, entry, refused = self.ui.text, self._jobs.entry, locked(state, *_LOCKED)
        if refused is not None:
            return text("jobs_page.next.moving") if state.moving else text("jobs_page.next.armed")
        if entry is None:
            return text("jobs_page.next.none")
        if not isinstance(self._load(entry), LoadedJob):
            return text("jobs_page.next.unreadable")
        return text("jobs_page.next.open", name=printable(entry.name))
