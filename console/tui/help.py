"""The lists of keys that `?` steps through: those of the page, then those that work everywhere."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.tui.keymap import ACTIONS, PageName, actions_of
from console.tui.lines import BLANK, Line, dim, fitted, line, wrapped
from console.tui.theme import Token

KEY_WIDTH = 8
LISTS = 2


def help_lines(text: Catalogue, page: PageName, number: int, width: int) -> list[Line]:
    """Return the list `number`, from 1 to `LISTS`; a sentence that is too long goes on in the next row."""
    if number == 1:
        rows = [line((text(f"page.{page}"), Token.TITLE))]
        for action in actions_of(page):
            rows += _row(action.shown, text(f"key_help.{action.id}"), width)
        return [*rows, BLANK, line(dim(text("help.more")))]
    rows = [line((text("help.everywhere"), Token.TITLE))]
    rows += _row("Space", text("help.stop"), width) + _row("F9", text("help.kill"), width)
    rows += _row("", text("help.unbound"), width)
    for action in ACTIONS:
        if action.page is None:
            rows += _row(action.shown, text(f"key_help.{action.id}"), width)
    return [*rows, line(dim(text("help.close")))]


def _row(shown: str, said: str, width: int) -> list[Line]:
    head, *more = wrapped(said, max(width - KEY_WIDTH, 1))
    rows: list[Line] = [((fitted(shown, KEY_WIDTH), Token.KEY), *head)]
    return rows + [(dim(" " * KEY_WIDTH), *row) for row in more]
