"""What the screens hold of the appearance while they run: texts, colours and filters that change in place.

Every panel has the same text and palette objects from its beginning, so that it follows without being told.
"""

from __future__ import annotations

from rich.style import Style
from textual.filter import LineFilter
from textual.theme import Theme

from console.session.appearance import Appearance
from console.text.catalogue import LiveCatalogue
from console.tui.theme import COLOUR, DARK_THEME, MONO, MONO_THEME, Palette, Token


class LiveLook:
    """Texts, palette and filters of an application; `mono` is a terminal without colour, whatever the theme.

    `wide` is one that shows the signs of frames and plots in two cells each: it gets ASCII, whatever the setting.
    """

    def __init__(self, palette: Palette, appearance: Appearance) -> None:
        self.mono, self.wide = palette is MONO, False
        self.text = LiveCatalogue(appearance.language)
        self.text.measure(appearance.units)
        self.palette: dict[Token, Style] = dict(palette)
        self.filters: tuple[LineFilter, ...] = ()
        self._paint(appearance)

    def theme(self, appearance: Appearance) -> Theme:
        """Return the theme of the frames."""
        if self.mono:
            return MONO_THEME
        if appearance.theme == "dark":
            return DARK_THEME
        from console.tui.application.themes import theme_named  # not for the first paint in the dark one

        return theme_named(appearance.theme)

    def change(self, appearance: Appearance) -> None:
        """Take over another appearance."""
        if appearance.language != self.text.language:
            self.text.speak(appearance.language)
        self.text.measure(appearance.units)
        self._paint(appearance)

    def _paint(self, appearance: Appearance) -> None:
        if not self.mono:
            self.palette.update(_palette(appearance.theme))
        if (self.wide or appearance.glyphs == "ascii") is not bool(self.filters):
            from console.tui.application.glyphs import AsciiGlyphs  # not for the first paint with Unicode

            self.filters = () if self.filters else (AsciiGlyphs(),)


def _palette(theme: str) -> Palette:
    if theme == "dark":
        return COLOUR
    from console.tui.application.themes import palette_named

    return palette_named(theme)
