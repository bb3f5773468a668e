"""The list of all keys, by page: what the key row has no room for."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.tui.keymap import ACTIONS, PageName, actions_of
from console.tui.lines import BLANK, Line, dim, fitted, line
from console.tui.theme import Token

KEY_WIDTH = 8


def help_lines(text: Catalogue, page: PageName) -> list[Line]:
    """Return the keys of this page, then those that work everywhere."""
    rows: list[Line] = [line((text(f"page.{page}"), Token.TITLE))]
    rows += [_row(action.shown, text(f"key.{action.id}")) for action in actions_of(page)]
    rows += [BLANK, line((text("help.everywhere"), Token.TITLE))]
    rows += [_row("Space", text("help.stop")), _row("F9", text("help.kill"))]
    rows += [line(dim(f"{'':{KEY_WIDTH}}{text('help.unbound')}"))]
    rows += [_row(action.shown, text(f"key.{action.id}")) for action in ACTIONS if action.page is None]
    return [*rows, BLANK, line(dim(text("help.close_hint")))]


def _row(shown: str, said: str) -> Line:
    return (fitted(shown, KEY_WIDTH), Token.KEY), (said, Token.TEXT)
