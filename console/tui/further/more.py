"""Page More: the pages without a digit, each with its letter and what it is for."""

from __future__ import annotations

from textual.widget import Widget

from console.tui.key_help import help_lines
from console.tui.keymap import ACTIONS, FURTHER, PageName
from console.tui.lines import Line, Sheet, dim, fit_text, line, wrap_line
from console.tui.page import Page, move_selection, rows_moved
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.problem import Problem

LETTERS = {action.id: action.shown for action in ACTIONS}
NAME_WIDTH = 14


class MorePage(Page):
    """Nothing on it moves anything."""

    name_ = PageName.MORE

    DEFAULT_CSS = """
    MorePage {
        layout: horizontal;
        Sheet { border: round $secondary; border-title-color: $foreground; height: 1fr; width: 1fr; }
        #more-keys { display: none; }
    }
    MorePage.-wide #more-keys { display: block; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._list = Sheet(ui.palette, id="more-list")
        self._keys = Sheet(ui.palette, id="more-keys")
        self.panels = (self._list, self._keys)
        self._selected = 0
        self._pages_of_rows: tuple[int, ...] = ()

    def act(self, action: str) -> None:
        """Choose a page, or show one."""
        if (by := rows_moved(action)) is not None:
            self._selected = move_selection(self._selected, by, len(FURTHER))
        elif action == "more.open":
            self.ui.go(FURTHER[self._selected])
        else:
            self.ui.go(PageName(action.removeprefix("more.")))

    def point(self, panel: Widget, row: int) -> None:
        """Choose the page in a row that was clicked."""
        if panel is self._list and 0 <= row < len(self._pages_of_rows):
            self._selected = self._pages_of_rows[row]

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return nothing: a page can always be looked at."""
        return ()

    def show(self, view: View) -> None:
        """Show the list."""
        self._list.show(self._rows(max(self._list.size.width, 1)), self.ui.text("page.more"))
        if self.has_class("-wide"):
            page, text = FURTHER[self._selected], self.ui.text
            _, *keys = help_lines(text, page, 1, max(self._keys.size.width, 1))
            self._keys.show(keys[:-2], text("more.keys", page=text(f"page.{page}")))

    def next_step(self, view: View) -> Line:
        """Return what the keys do."""
        return line((self.ui.text("more.next"), Token.ACTION))

    def _rows(self, width: int) -> list[Line]:
        text, rows, numbers = self.ui.text, list[Line](), list[int]()
        for number, page in enumerate(FURTHER):
            chosen = number == self._selected
            name = fit_text(text(f"page.{page}"), NAME_WIDTH)
            mark = ("▶ ", Token.ACTION) if chosen else dim("  ")
            head = (
                mark,
                (f"{LETTERS[f'more.{page}']}  ", Token.KEY),
                (name, Token.SELECTED if chosen else Token.TEXT),
            )
            used = 5 + NAME_WIDTH + 1
            about = wrap_line(text(f"more.about.{page}"), max(width - used, 8), Token.DIM)
            rows.append((*head, dim(" "), *about[0]))
            rows += [(dim(" " * used), *more) for more in about[1:]]
            numbers += [number] * len(about)
        self._pages_of_rows = tuple(numbers)
        return rows
