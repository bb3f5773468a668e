"""The themes besides the dark one: light, high contrast, the sixteen colours of the terminal, colour-blind safe.

Imported when one of them is chosen: not for the first paint in the dark one.
"""

from __future__ import annotations

from functools import cache

from rich.style import Style
from textual.theme import Theme

from console.tui.theme import DARK, DARK_THEME, MONO_THEME, Colours, Palette, Token, palette_of, theme_of

LIGHT = Colours(
    background="#f4f4f0",
    text="#262626",
    dim="#5f5f5f",
    bright="#000000",
    action="#005faf",
    warning="#875f00",
    alarm="#af0000",
    sim="#87005f",
    ring="#a8a8a8",
    before="#af3a00",
    after="#005f87",
    block="#ffffff",
    lit="#000000",
)
CONTRAST = Colours(
    background="#000000",
    text="#ffffff",
    dim="#d0d0d0",
    bright="#ffffff",
    action="#87d7ff",
    warning="#ffff00",
    alarm="#ff8787",
    sim="#ff87ff",
    ring="#9e9e9e",
    before="#ffaf00",
    after="#5fffff",
    block="#000000",
    lit="#ffffff",
)
COLOUR_BLIND = Colours(  # M. Okabe and K. Ito, Color Universal Design, 2008; the blue and the red are lightened
    background="#121416",
    text="#c6c6c6",
    dim="#8a8a8a",
    bright="#ffffff",
    action="#56b4e9",
    warning="#f0e442",
    alarm="#ff7f2a",
    sim="#cc79a7",
    ring="#626262",
    before="#e69f00",
    after="#56b4e9",
    block="#000000",
    lit="#ffffff",
)

_FRONT = {
    Token.ACTION: "bright_blue",
    Token.WARNING: "yellow",
    Token.BEFORE: "yellow",
    Token.COMMAND: "yellow",
    Token.AFTER: "cyan",
    Token.WANTED: "cyan",
}
_BLOCKS = {Token.ALARM: "red", Token.SIM: "magenta"}
_BOLD = (Token.STRONG, Token.TITLE, Token.ACTION, Token.WARNING, Token.KEY, Token.MARK)
_REVERSED = (Token.SELECTED, Token.STOP)


def _of_the_terminal(token: Token) -> Style:
    """Return a style of the terminal's own sixteen colours; text and background are its own, dark or light."""
    if token in _BLOCKS:
        return Style(color="bright_white", bgcolor=_BLOCKS[token], bold=True)
    return Style(
        color=_FRONT.get(token, "default"),
        bgcolor="default",
        bold=token in _BOLD,
        reverse=token in _REVERSED,
        strike=token is Token.STALE,
    )


@cache
def palette_named(name: str) -> Palette:
    """Return the palette of a theme in `THEMES`."""
    if name == "16-colour":
        return {token: _of_the_terminal(token) for token in Token}
    return palette_of(_COLOURS[name])


@cache
def theme_named(name: str) -> Theme:
    """Return the frames of a theme in `THEMES`."""
    if name == "16-colour":
        return MONO_THEME
    return DARK_THEME if name == "dark" else theme_of(name, _COLOURS[name], dark=name != "light")


_COLOURS = {"dark": DARK, "light": LIGHT, "contrast": CONTRAST, "colour-blind": COLOUR_BLIND}
