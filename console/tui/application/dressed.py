"""An application in the appearance that the operator has set: theme, language, glyphs, changed while it runs."""

from __future__ import annotations

from collections.abc import Sequence

from rich.style import Style
from textual.app import App
from textual.driver import Driver
from textual.filter import LineFilter
from textual.theme import Theme

from console.session.appearance import Appearance
from console.text.catalogue import LiveCatalogue
from console.tui.application.key_releases import KeyReleases
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


class DressedApp(App[None]):
    """`look` has the texts and colours that every panel is given."""

    def __init__(self, palette: Palette, appearance: Appearance, driver_class: type[Driver] | None) -> None:
        self.look = LiveLook(palette, appearance)
        # Without colour, Textual must know before it chooses its filters to use the terminal's own colours.
        super().__init__(driver_class=driver_class, ansi_color=True if self.look.mono else None)
        theme = self._registered(appearance)
        if theme is DARK_THEME:  # the style sheet is not read yet: like this it is read once, not once more
            self.set_reactive(App.theme, theme.name)
            self.stylesheet.set_variables(self.get_css_variables())
        else:
            self.theme = theme.name

    def dress(self, appearance: Appearance) -> None:
        """Draw everything anew in another appearance."""
        self.look.change(appearance)
        self.theme = self._registered(appearance).name
        for widget in (self.screen, *self.screen.query()):
            widget.notify_style_update()
            widget.refresh()

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return Textual's filters, and that of the glyphs."""
        return (*super().get_line_filters(), *self.look.filters)

    def offer_mouse(self, on: bool) -> None:
        """Have the terminal report clicks and the wheel, or not; a driver without a terminal has none."""
        report = getattr(self._driver, "report_mouse", None)
        if report is not None:
            report(on)

    def offer_releases(self, on: bool) -> KeyReleases | None:
        """Have the terminal report releases of keys, or not; return what is known of them, None without any."""
        report = getattr(self._driver, "report_releases", None)
        if report is not None:
            report(on)
        releases: KeyReleases | None = getattr(self._driver, "releases", None)
        return releases

    def _registered(self, appearance: Appearance) -> Theme:
        theme = self.look.theme(appearance)
        if theme.name not in self.available_themes:
            self.register_theme(theme)
        return theme
