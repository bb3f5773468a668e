"""The themes besides the dark one: light, high contrast, the sixteen colours of the terminal, colour-blind safe.

Imported when one of them is chosen: not for the first paint in the dark one.
"""

from __future__ import annotations

from functools import cache

from rich.style import Style
from textual.theme import Theme

from console.tui.theme import DARK, DARK_THEME, MONO_THEME, Palette, Token, colours_of, palette_of, theme_of

LIGHT = colours_of("f4f4f0 262626 5f5f5f 000000 005faf 875f00 af0000 87005f a8a8a8 af3a00 005f87 ffffff 000000")
CONTRAST = colours_of("000000 ffffff d0d0d0 ffffff 87d7ff ffff00 ff8787 ff87ff 9e9e9e ffaf00 5fffff 000000 ffffff")
# M. Okabe and K. Ito, Color Universal Design, 2008; the blue and the red are lightened
COLOUR_BLIND = colours_of(
    "121416 c6c6c6 8a8a8a ffffff 56b4e9 f0e442 ff7f2a cc79a7 626262 e69f00 56b4e9 000000 ffffff"
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
