"""An application in the appearance that the operator has set: theme, language, glyphs, changed while it runs."""

from __future__ import annotations

from collections.abc import Sequence

from textual.app import App
from textual.driver import Driver
from textual.filter import LineFilter
from textual.theme import Theme

from console.session.appearance import Appearance
from console.tui.application.key_releases import KeyReleases
from console.tui.application.live import LiveLook
from console.tui.theme import DARK_THEME, Palette


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
