"""Page Controller: identity, status bits, watch table, terminal, and the configuration of the controller."""

from __future__ import annotations

from textual.containers import Vertical

from console.tui.controller.views import VIEWS, ControllerViews, ViewName
from console.tui.entry import EntryLine
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, line
from console.tui.page import Page, rows_moved
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.problem import Problem

WIDE = 150  # columns from which the terminal is beside the view
BESIDE = (ViewName.TERMINAL, ViewName.WATCH, ViewName.STATUS)  # what is shown besides, the first beside the view


class ControllerPage(Page):
    """Nothing on it moves anything: what it sends are queries."""

    name_ = PageName.CONTROLLER

    DEFAULT_CSS = """
    ControllerPage {
        layout: horizontal;
        layers: base entry;
        Sheet { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground;
            width: 1fr; height: 1fr; }
        #controller-left { width: 1fr; height: 1fr; }
        #controller-beside, #controller-below { display: none; }
        #controller-entry { width: 60%; offset: 4 1; }
    }
    ControllerPage.-two #controller-beside { display: block; }
    ControllerPage.-two.-tall #controller-below { display: block; height: 40%; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._sheet = Sheet(ui.palette, id="controller-view")
        self._beside = Sheet(ui.palette, id="controller-beside")
        self._below = Sheet(ui.palette, id="controller-below")
        self._entry = EntryLine(id="controller-entry")
        self.panels = (Vertical(self._sheet, self._below, id="controller-left"), self._beside, self._entry)
        self._views = ControllerViews(ui)

    def act(self, action: str) -> None:
        """Show another view, scroll, ask, read, write a backup."""
        if self._entry.is_open:
            if action == "controller.enter":
                self._take_entry()
            return
        if (by := rows_moved(action, max(self._sheet.size.height - 2, 1))) is not None:
            self._views.move(by, page=action not in ("controller.up", "controller.down"))
        elif action in ("controller.left", "controller.right"):
            self._views.step(-1 if action == "controller.left" else 1)
        elif not self.ui.answers(self.why_not(action, self.ui.view)):
            if action == "controller.enter" and self._views.view in (ViewName.WATCH, ViewName.TERMINAL):
                self._entry.begin()
            else:
                with self.ui.answering():
                    self._views.do(action.removeprefix("controller."))

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why an action cannot be done now."""
        return self._views.why_not(action.removeprefix("controller."), view.state)

    def fit(self) -> None:
        """Show the terminal beside the view where there is room, on a tall terminal the watch table below it."""
        super().fit()
        self.set_class(self.size.width >= WIDE, "-two")

    def show(self, view: View) -> None:
        """Show the newest state, and ask for what the views show."""
        if self._entry.is_open and (view.state.may_move or view.state.seen_moving):
            self._entry.close()
            self.ui.say("screen.entry_moving")
        self._entry.keep_focus()
        first, panels = self._views.view, [self._sheet]
        if self.has_class("-two"):
            panels += [self._beside, *([self._below] if self.has_class("-tall") else [])]
        others = (each for each in BESIDE if each is not first)
        shown = dict(zip(panels, (first, *others), strict=False))
        self._views.follow(view, frozenset(shown.values()))
        for panel, name in shown.items():
            self._paint(panel, name, view)

    def next_step(self, view: View) -> Line:
        """Return what the keys do in this view."""
        return line((self._views.next_words(typing=self._entry.is_open), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what the view shows, uncut."""
        return self._views.lines(self._views.view, view, width, None)

    @property
    def field(self) -> FieldKind:
        """Free text while an item or a query is typed, and nothing moves: in any doubt Space stops."""
        state = self.ui.control.state
        moving = state.may_move or state.seen_moving
        return FieldKind.TEXT if self._entry.is_open and not moving else FieldKind.NONE

    def leave(self) -> None:
        """End an entry, and what is being read."""
        self._entry.close()
        self._views.leave()

    def _paint(self, sheet: Sheet, shown: ViewName, view: View) -> None:
        width, height = max(sheet.size.width, 1), max(sheet.size.height, 1)
        rows = self._views.lines(shown, view, width, height)
        if self._entry.is_open and sheet is self._sheet:
            rows = [(), *rows[: height - 1]]  # the entry lies over the first row
        title = "  ".join(
            f"[{name}]" if each is shown else name
            for each in (VIEWS if sheet is self._sheet else (shown,))
            for name in (self.ui.text(f"controller_page.view.{each}"),)
        )
        sheet.show(rows, title, self._views.subtitle(shown))

    def _take_entry(self) -> None:
        if words := self._entry.close():
            with self.ui.answering():
                self._views.take(words)
