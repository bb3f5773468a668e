"""Base classes of the pages: containers that get a view ten times a second, and the actions of their keys.

Layout of the rows and the page between them, and the terminal sizes below which less can be done.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import ClassVar

from textual.app import ComposeResult
from textual.containers import Container
from textual.events import Resize
from textual.geometry import Size
from textual.widget import Widget

from console.tui.gate import FieldKind
from console.tui.keymap import Action, PageName, RowKey
from console.tui.lines import Line
from console.tui.ui_context import UiContext, View
from profiles.problem import Problem

SMALLEST = (60, 18)  # columns and rows below which no page is shown and nothing can be started
SMALLEST_TO_MOVE = (80, 24)  # columns and rows below which pages are shown, but motion cannot be commanded
WIDE = 140  # columns from which a page shows side by side what is behind a key elsewhere
TALL_ROWS = 36  # rows of the page from which it shows further panels below

CSS = """
Screen { layout: vertical; background: $background; color: $foreground; }
.row { height: 1; width: 1fr; }
#body { height: 1fr; width: 1fr; }
.page { height: 1fr; width: 1fr; }
#list, #small { height: 1fr; width: 1fr; padding: 0 1; display: none; }
.page.-away { display: none; }
.reading #list { display: block; }
.reading .page { display: none; }
.small .row, .small #body { display: none; }
.small #small { display: block; padding: 0; }
"""


def find_size_problems(action: Action, size: Size) -> tuple[Problem, ...]:
    """Return why nothing may be moved on a terminal of this size, empty where it may."""
    columns, rows = SMALLEST_TO_MOVE
    if action.moves and (size.width < columns or size.height < rows):
        return (Problem(code="screen.cramped", limit=f"{columns} x {rows}"),)
    return ()


def is_small(size: Size) -> bool:
    """Whether there is no room for a page."""
    return size.width < SMALLEST[0] or size.height < SMALLEST[1]


ROWS_FOR_PLOTS = 16  # rows of the page below which numbers take the room of the plots
_ROOMY_ROWS = 22


def rows_moved(action: str, page_rows: int = 1) -> int | None:
    """Return by how many rows a key moves in a list with so many rows on a page; None for any other key."""
    by = {"up": -1, "down": 1, "page_up": -page_rows, "page_down": page_rows}
    return {**by, "first": -sys.maxsize, "last": sys.maxsize}.get(action.partition(".")[2])


def move_selection(place: int, by: int, count: int) -> int:
    """Return the place in a list of so many rows after a move; 0 in an empty one."""
    return min(max(place + by, 0), max(count - 1, 0))


class Page(Container):
    """One of the numbered pages, made of `panels`. Nothing covers it, and it covers nothing."""

    name_: ClassVar[PageName]
    DEFAULT_CSS = """
    Page .panel { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(id=f"page-{self.name_}", classes="page")
        self.ui = ui
        self.panels: Sequence[Widget] = ()

    def compose(self) -> ComposeResult:
        """Return the panels."""
        yield from self.panels

    def fit(self) -> None:
        """Choose the layout for the room: at each tick, because an event may be missed while it is mounted."""
        self.set_class(self.size.width >= WIDE, "-wide")
        self.set_class(self.size.height >= TALL_ROWS, "-tall")

    def on_resize(self, event: Resize) -> None:
        """Adapt to the new size."""
        self.fit()

    def show(self, view: View) -> None:
        """Show the newest state. Called only while the page is visible."""

    def act(self, action: str) -> None:
        """Perform the action of one of the page's own keys."""

    def point(self, panel: Widget, row: int) -> None:
        """Choose what is in a row of a panel, from 0: a click at rest. Nothing moves, and nothing is confirmed."""

    def note_action(self, action: str | None) -> None:
        """Note a key before it is acted on, whatever it means: the action, None without one."""

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why an action of the page cannot be done now: what its key answers. Empty where it can."""
        return ()

    def next_step(self, view: View) -> Line:
        """Return the next thing to do, with its key."""
        raise NotImplementedError

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what the page asks the operator to do or to correct, uncut, for the list of messages."""
        return []

    def open_named(self, name: str) -> None:
        """Open the job of a scanned code, or say why not: for the page that lists the jobs."""

    @property
    def chosen_alarm(self) -> Problem | None:
        """The alarm that the key of every page acknowledges here; None for the foremost."""
        return None

    @property
    def keys(self) -> tuple[RowKey, ...]:
        """The keys of what is open in the place of the page; empty for those of the page."""
        return ()

    @property
    def field(self) -> FieldKind:
        """The kind of field that has the focus."""
        return FieldKind.NONE

    def leave(self) -> None:
        """End an entry, and disable what was enabled: the operator leaves the page."""


class ChartPage(Page):
    """A page of plots with texts beside them, or another panel in their place; painted when something changed."""

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self.texts: Sequence[Widget] = ()
        self._view: View | None = None
        self._painted_for: list[Size] = []

    def news(self, view: View) -> tuple[object, ...]:
        """Return what the page shows of a view; immutable objects by their identity."""
        raise NotImplementedError

    def paint(self, view: View) -> None:
        """Show everything anew."""
        raise NotImplementedError

    def show(self, view: View) -> None:
        """Show the newest state; also where a text has another size, some time after a resize."""
        before, self._view = self._view, view
        sizes = [text.size for text in self.texts]
        if before is None or self.news(before) != self.news(view) or sizes != self._painted_for:
            self.paint_again()

    def paint_again(self) -> None:
        """Show the last view again."""
        if self._view is not None:
            self._painted_for = [text.size for text in self.texts]
            self.paint(self._view)

    def fit(self) -> None:
        """Show plots where there is room for them."""
        super().fit()
        height = self.size.height
        self.set_class(height < ROWS_FOR_PLOTS, "-bare")
        self.set_class(height >= _ROOMY_ROWS, "-roomy")

    def on_resize(self, event: Resize) -> None:
        """Adapt to the new size."""
        self.fit()
        self.call_after_refresh(self.paint_again)

    def see(self, target: Widget, panels: Sequence[Widget]) -> None:
        """Show one of these panels in the place of the others; it needs a layout before it knows its size."""
        if not target.display:
            for each in panels:
                each.display = each is target
            if self.is_attached:
                self.call_after_refresh(self.paint_again)
