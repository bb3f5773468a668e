"""Colours of the screens: every word, line and trace has a token, a token has a style.

Normal is grey; colour appears when something needs attention, and is never the only sign: each state also
has a word and a mark. Magenta is the simulator's. All colours are distinct in 256-colour terminals.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, auto
from typing import Any

from rich.style import Style
from textual.theme import Theme


class Token(Enum):
    """Meaning of a piece of the screen."""

    TEXT = auto()
    DIM = auto()  # needs no attention: units, frames, finished steps
    STRONG = auto()
    TITLE = auto()
    SELECTED = auto()  # the row or page with the focus
    ACTION = auto()  # what the operator does next
    OK = auto()
    WARNING = auto()
    ALARM = auto()
    STALE = auto()  # a value that is out of date
    SIM = auto()
    STOP = auto()
    KEY = auto()
    AXIS = auto()
    RING = auto()
    TOLERANCE = auto()  # the rings between which a round part lies
    MARK = auto()
    BEFORE = auto()
    AFTER = auto()
    COMMAND = auto()
    WANTED = auto()


BACKGROUND = "#121416"
_GREY, _DIM, _BRIGHT = "#c6c6c6", "#8a8a8a", "#ffffff"
_BLUE, _YELLOW, _RED = "#5fafff", "#ffd75f", "#ff5f5f"
_MAGENTA, _CYAN, _ORANGE = "#d75fd7", "#5fd7d7", "#ffaf5f"
Palette = Mapping[Token, Style]  # a style for every token: a strip without a style is not drawn safely


def _on_dark(colour: str, bold: bool = False, strike: bool = False) -> Style:
    return Style(color=colour, bgcolor=BACKGROUND, bold=bold, strike=strike)


def _block(background: str) -> Style:
    return Style(color="#000000", bgcolor=background, bold=True)


COLOUR: Palette = {
    Token.TEXT: _on_dark(_GREY),
    Token.DIM: _on_dark(_DIM),
    Token.STRONG: _on_dark(_BRIGHT, bold=True),
    Token.TITLE: _on_dark(_GREY, bold=True),
    Token.SELECTED: _block(_GREY),
    Token.ACTION: _on_dark(_BLUE, bold=True),
    Token.OK: _on_dark(_GREY),
    Token.WARNING: _on_dark(_YELLOW, bold=True),
    Token.ALARM: _block(_RED),
    Token.STALE: _on_dark(_DIM, strike=True),
    Token.SIM: _block(_MAGENTA),
    Token.STOP: _block(_BRIGHT),
    Token.KEY: _on_dark(_BRIGHT),
    Token.AXIS: _on_dark(_DIM),
    Token.RING: _on_dark("#626262"),
    Token.TOLERANCE: _on_dark(_GREY),
    Token.MARK: _on_dark(_BRIGHT, bold=True),
    Token.BEFORE: _on_dark(_ORANGE),
    Token.AFTER: _on_dark(_CYAN),
    Token.COMMAND: _on_dark(_ORANGE),
    Token.WANTED: _on_dark(_CYAN),
}

_REVERSED = (Token.SELECTED, Token.ALARM, Token.SIM, Token.STOP)
_BOLD = (Token.STRONG, Token.TITLE, Token.ACTION, Token.WARNING, Token.KEY, Token.MARK)

MONO: Palette = {
    token: Style(color="default", bgcolor="default", reverse=token in _REVERSED, bold=token in _BOLD)
    for token in Token
}
"""For terminals without colour: words and marks carry everything."""

DARK_THEME = Theme(
    name="trilobe-dark",
    primary=_GREY,
    secondary=_DIM,
    accent=_BLUE,
    warning=_YELLOW,
    error=_RED,
    success=_GREY,
    foreground=_GREY,
    background=BACKGROUND,
    surface=BACKGROUND,
    panel=BACKGROUND,
    dark=True,
)

_ANSI: Any = "ansi_default"
MONO_THEME = Theme(
    name="trilobe-mono",
    **dict.fromkeys(("primary", "secondary", "accent", "warning", "error", "success"), _ANSI),
    **dict.fromkeys(("foreground", "background", "surface", "panel"), _ANSI),
    dark=True,
    ansi=True,
    variables={"ansi-background": "ansi_default", "ansi-foreground": "ansi_default"},
)
