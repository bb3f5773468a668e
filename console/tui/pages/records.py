"""Page Records: the recorded runs, newest first; one as it was, two side by side, the run chart of a job."""

from __future__ import annotations

from dataclasses import replace

from console.session.data.run_reader import RunFilters
from console.session.learning.job_chart import ChartedQuantity, JobChart
from console.session.station.state import StationState
from console.tui.entry import EntryLine
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line, line
from console.tui.page import ChartPage
from console.tui.records.background_reader import Problems
from console.tui.records.list_lines import RunList
from console.tui.records.panels import RecordsPanels, RecordsView, full_lines
from console.tui.records.reading import ALL, PIECE, ListQuery, OpenedRuns, RecordsReader, RunListing
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.problem import Problem

STEPS = {"records.up": -1, "records.down": 1}
BEHIND = {
    "records.program": RecordsView.PROGRAM,
    "records.cut": RecordsView.CUT,
    "records.length": RecordsView.LENGTH,
}
FILTERS = ("records.search", "records.failed", "records.job", "records.machines")


class RecordsPage(ChartPage):
    """Nothing on it moves anything, or writes."""

    name_ = PageName.RECORDS

    DEFAULT_CSS = """
    RecordsPage {
        layout: vertical;
        layers: base entry;
        #records-entry { width: 60%; offset: 4 1; }
    }
    RecordsPage #records-claims { height: 8; }
    RecordsPage.-bare #records-left { display: none; }
    RecordsPage.-bare #records-view { display: none; }
    RecordsPage.-bare #records-claims { height: 1fr; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._panels = RecordsPanels(ui)
        self._entry = EntryLine(id="records-entry")
        self.panels = (*self._panels.all, self._entry)
        self._reader = RecordsReader(ui.data, ui.machine)
        self._mode = RecordsView.LIST
        self._filters = RunFilters()
        self._everywhere = False
        self._words = ""
        self._count, self._to_end = PIECE, False
        self._visits, self._away = 0, True
        self._list: RunList | None = None
        self._marked: str | None = None
        self._run_id = ""
        self._figure = ChartedQuantity.RONT
        self._top = 0
        self._found: RunListing | OpenedRuns | JobChart | Problems | None = None
        self._shown: object = None

    def act(self, action: str) -> None:  # noqa: C901 - one branch a case
        """Select, open, filter, compare, chart."""
        if self._is_typing:
            if action == "records.open":
                self._take_words()
        elif action in STEPS or action in (
            "records.page_up",
            "records.page_down",
            "records.first",
            "records.last",
        ):
            self._move(action)
        elif action == "records.open":
            self._open()
        elif action == "records.back":
            self._go(RecordsView.RUN if self._mode in BEHIND.values() else RecordsView.LIST)
        elif self.ui.answers(self.why_not(action, self.ui.view)):
            return
        elif action == "records.search":
            self._type_words()
        elif action in FILTERS:
            self._filter(action)
        elif action == "records.mark":
            self._mark()
        elif action in BEHIND:
            self._look_behind(BEHIND[action])
        else:
            self._chart(action)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a filter, or what is behind a run, cannot be had here."""
        behind_chart = action in BEHIND and self._mode is RecordsView.CHART
        if behind_chart or (action in FILTERS and self._mode is not RecordsView.LIST):
            return (Problem(code="screen.records_list_first"),)
        if action == "records.job" and view.work is None and self._filters.job is None:
            return (Problem(code="screen.nothing_to_cut"),)
        return ()

    def show(self, view: View) -> None:
        """Read what is to be shown, and paint what has changed."""
        self._view = view
        if self._away:
            self._away, self._visits = False, self._visits + 1
        self._entry.keep_focus()
        self._read(view.state)
        shown = (self._mode, id(self._found), self._list, self._top, self._is_typing, self._run_query(view.state))
        sizes = self._panels.sizes
        if (shown, sizes) != self._shown:
            self._shown = (shown, sizes)
            self.paint(view)

    def paint(self, view: View) -> None:
        """Show everything anew."""
        target = self._panels.panel_for(self._mode, self._found)
        self.see(target, self._panels.all)
        if self._mode is RecordsView.LIST:
            wanted = self._run_query(view.state)
            self._panels.show_list(
                self._list, wanted, self._found, everywhere=self._everywhere, typing=self._is_typing
            )
        else:
            self._top = self._panels.show(self._mode, self._found, self._top)

    @property
    def field(self) -> FieldKind:
        """Free text while the words of a search are typed."""
        return FieldKind.TEXT if self._is_typing else FieldKind.NONE

    def leave(self) -> None:
        """End an entry; the record is read again when the page is shown the next time."""
        self._entry.close()
        self._away = True

    def next_step(self, view: View) -> Line:
        """Return what the keys show."""
        mode = "typing" if self._is_typing else str(self._mode)
        if mode == RecordsView.LIST and (self._list is None or self._list.row is None):
            mode = (
                "empty" if isinstance(self._found, RunListing) else "reading" if self._found is None else "problem"
            )
        elif mode == RecordsView.LIST and self._marked is not None:
            mode = "marked"
        return line((self.ui.text(f"records_page.next.{mode}"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return everything that is told of what is open, or why it cannot be read."""
        return full_lines(self._mode, self._found, self.ui.text, width)

    def _read(self, state: StationState) -> None:
        if self._mode is RecordsView.LIST:
            self._found = self._reader.listing(self._run_query(state))
            if isinstance(self._found, RunListing):
                self._list = self._at_its_run(self._found)
            elif self._found is not None:
                self._list = None
        elif self._mode is RecordsView.CHART:
            row = None if self._list is None else self._list.row
            if row is not None:
                version = self._version(state)
                self._found = self._reader.chart(row, self._figure, version, moving=state.may_move)
        else:
            pair = self._mode is RecordsView.PAIR and self._marked is not None
            run_ids = (self._marked or "", self._run_id) if pair else (self._run_id,)
            self._found = self._reader.open_runs(run_ids, self._version(state), moving=state.may_move)

    def _at_its_run(self, listing: RunListing) -> RunList:
        """Return a list with the selection on the same run as before, else near it."""
        before = self._list
        if self._to_end and not listing.more:
            self._to_end = False
            return RunList(listing=listing, selected=max(len(listing.rows) - 1, 0), marked=self._marked)
        if before is None:
            return RunList(listing=listing, selected=0, marked=self._marked)
        place = before.selected
        if before.listing is not listing and before.selected > 0:
            found = listing.place_of(None if before.row is None else before.row.run_id)
            place = min(place, len(listing.rows) - 1) if found is None else found
        return RunList(listing=listing, selected=max(place, 0), marked=self._marked)

    def _run_query(self, state: StationState) -> ListQuery:
        here = None if self._everywhere else self.ui.machine.machine.name
        simulated = None if self._everywhere else state.simulated
        filters = replace(self._filters, machine=here, simulated=simulated)
        return ListQuery(filters=filters, words=self._words, version=self._version(state), count=self._count)

    def _version(self, state: StationState) -> tuple[object, ...]:
        """Return what changes when this console may have added to the record, or somebody looks again."""
        return self._visits, id(state.measured), state.cut_done, state.armed is not None

    def _move(self, action: str) -> None:
        listing = self._list
        page = self._panels.page_rows(self._mode)
        ways = {**STEPS, "records.page_up": -page, "records.page_down": page, "records.first": -ALL}
        by = ways.get(action, ALL)
        if self._mode is not RecordsView.LIST:
            self._top = max(self._top + by, 0)
        elif listing is not None:
            last = len(listing.listing.rows) - 1
            place = min(max(listing.selected + by, 0), max(last, 0))
            self._list = replace(listing, selected=place)
            self._to_end = by == ALL and listing.listing.more
            if listing.listing.more and (by == ALL or place + page + PIECE // 2 > last):
                self._count = ALL if by == ALL else max(self._count, last + 1 + PIECE)

    def _open(self) -> None:
        row = None if self._list is None else self._list.row
        if self._mode is RecordsView.LIST and row is not None:
            self._run_id = row.run_id
            self._go(RecordsView.RUN if self._marked in (None, row.run_id) else RecordsView.PAIR)

    def _look_behind(self, mode: RecordsView) -> None:
        """Show the program or the telemetry of the selected or open run; again: the run."""
        if self._mode is mode:
            self._go(RecordsView.RUN)
        elif self._mode is RecordsView.LIST:
            row = None if self._list is None else self._list.row
            if row is not None:
                self._run_id = row.run_id
                self._go(mode)
        else:
            self._go(mode)

    def _chart(self, action: str) -> None:
        """Show the run chart of the selected run's job, of RONt or diameter; again: the list."""
        if self._mode is RecordsView.CHART and action == "records.chart":
            self._go(RecordsView.LIST)
            return
        if self._mode is RecordsView.CHART or action == "records.figure":
            self._figure = (
                ChartedQuantity.RONT if self._figure is ChartedQuantity.DIAMETER else ChartedQuantity.DIAMETER
            )
        if self._list is not None and self._list.row is not None:
            self._go(RecordsView.CHART)

    def _mark(self) -> None:
        row = None if self._list is None else self._list.row
        if row is not None and self._mode is not RecordsView.CHART:
            self._marked = None if self._marked == row.run_id else row.run_id
            if self._mode is RecordsView.PAIR:
                self._go(RecordsView.LIST)

    def _filter(self, action: str) -> None:
        if action == "records.failed":
            self._filters = replace(self._filters, failed=not self._filters.failed)
        elif action == "records.machines":
            self._everywhere = not self._everywhere
        elif self._filters.job is not None:
            self._filters = replace(self._filters, job=None)
        elif self.ui.job is not None:
            self._filters = replace(self._filters, job=self.ui.job.name)
        self._begin_list()

    def _begin_list(self) -> None:
        self._count, self._to_end, self._list = PIECE, False, None

    def _go(self, mode: RecordsView) -> None:
        if mode is not self._mode:
            self._mode, self._top, self._found = mode, 0, None

    @property
    def _is_typing(self) -> bool:
        return self._entry.is_open

    def _type_words(self) -> None:
        self._entry.begin(self._words, marked=True)  # a character begins another search

    def _take_words(self) -> None:
        self._words = self._entry.close()
        self._begin_list()
