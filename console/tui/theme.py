"""Colours of the screens: every word, line and trace has a token, a token has a style.

Normal is grey; colour appears when something needs attention, and is never the only sign: each state also
has a word and a mark. Magenta is the simulator's. All colours are distinct in 256-colour terminals. Here are the
dark theme and the one without colour; the others are in `settings/themes.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, auto
from typing import Any

from rich.style import Style
from textual.theme import Theme


class Token(IntEnum):  # the hash of an int is at hand, and lines are looked up by their pieces
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
    HIGH = auto()  # on a map of a surface
    LOW = auto()


Palette = Mapping[Token, Style]  # a style for every token: a strip without a style is not drawn safely


@dataclass(frozen=True, slots=True)
class Colours:
    """The colours of a theme; `block` is the text on a coloured block, `lit` the block of the stop key."""

    background: str
    text: str
    dim: str
    bright: str
    action: str
    warning: str
    alarm: str
    sim: str
    ring: str
    before: str
    after: str
    block: str
    lit: str


def colours_of(row: str) -> Colours:
    """Return the colours that a row states in their order, in hexadecimal."""
    return Colours(*(f"#{each}" for each in row.split()))


DARK = colours_of("121416 c6c6c6 8a8a8a ffffff 5fafff ffd75f ff5f5f d75fd7 626262 ffaf5f 5fd7d7 000000 ffffff")
BACKGROUND = DARK.background


def palette_of(colours: Colours) -> Palette:
    """Return the style of each token in a theme."""

    def on(colour: str, bold: bool = False, strike: bool = False) -> Style:
        return Style(color=colour, bgcolor=colours.background, bold=bold, strike=strike)

    def block(background: str) -> Style:
        return Style(color=colours.block, bgcolor=background, bold=True)

    return {
        Token.TEXT: on(colours.text),
        Token.DIM: on(colours.dim),
        Token.STRONG: on(colours.bright, bold=True),
        Token.TITLE: on(colours.text, bold=True),
        Token.SELECTED: block(colours.text),
        Token.ACTION: on(colours.action, bold=True),
        Token.OK: on(colours.text),
        Token.WARNING: on(colours.warning, bold=True),
        Token.ALARM: block(colours.alarm),
        Token.STALE: on(colours.dim, strike=True),
        Token.SIM: block(colours.sim),
        Token.STOP: block(colours.lit),
        Token.KEY: on(colours.bright),
        Token.AXIS: on(colours.dim),
        Token.RING: on(colours.ring),
        Token.TOLERANCE: on(colours.text),
        Token.MARK: on(colours.bright, bold=True),
        Token.BEFORE: on(colours.before),
        Token.AFTER: on(colours.after),
        Token.COMMAND: on(colours.before),
        Token.WANTED: on(colours.after),
        Token.HIGH: on(colours.before),
        Token.LOW: on(colours.after),
    }


def theme_of(name: str, colours: Colours, *, dark: bool) -> Theme:
    """Return the theme of the frames and fields beside the palette."""
    return Theme(
        name=f"trilobe-{name}",
        primary=colours.text,
        secondary=colours.dim,
        accent=colours.action,
        warning=colours.warning,
        error=colours.alarm,
        success=colours.text,
        foreground=colours.text,
        background=colours.background,
        surface=colours.background,
        panel=colours.background,
        dark=dark,
    )


COLOUR: Palette = palette_of(DARK)
DARK_THEME = theme_of("dark", DARK, dark=True)

COLOUR_VARIABLE = "NO_COLOR"
"""Variable of the terminal's owner: with it nothing has a colour (no-color.org)."""

_REVERSED = (Token.SELECTED, Token.ALARM, Token.SIM, Token.STOP)
_BOLD = (Token.STRONG, Token.TITLE, Token.ACTION, Token.WARNING, Token.KEY, Token.MARK)

MONO: Palette = {
    token: Style(color="default", bgcolor="default", reverse=token in _REVERSED, bold=token in _BOLD)
    for token in Token
}
"""For terminals without colour: words and marks carry everything."""

_ANSI: Any = "ansi_default"
MONO_THEME = Theme(
    name="trilobe-mono",
    **dict.fromkeys(("primary", "secondary", "accent", "warning", "error", "success"), _ANSI),
    **dict.fromkeys(("foreground", "background", "surface", "panel"), _ANSI),
    dark=True,
    ansi=True,
    variables={"ansi-background": "ansi_default", "ansi-foreground": "ansi_default"},
)
