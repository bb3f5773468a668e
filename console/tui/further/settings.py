"""Page Settings: what this console was started with."""

from __future__ import annotations

from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, dim, fitted, line
from console.tui.page import Page
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View

LABEL_WIDTH = 16


class SettingsPage(Page):
    """Nothing on it moves anything."""

    name_ = PageName.SETTINGS

    DEFAULT_CSS = """
    SettingsPage { Sheet { border: round $secondary; border-title-color: $foreground; height: 1fr; } }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._list = Sheet(ui.palette, id="settings-list")
        self.panels = (self._list,)

    def show(self, view: View) -> None:
        """Show the settings."""
        text = self.ui.text
        self._list.border_title = text("page.settings")
        values = {
            "machine": self.ui.machine.machine.name,
            "language": text("settings.language_name"),
        }
        rows = [line(dim(fitted(text(f"settings.{key}"), LABEL_WIDTH)), value) for key, value in values.items()]
        self._list.show(rows)

    def next_step(self, view: View) -> Line:
        """Return how to change one."""
        return line((self.ui.text("settings.next"), Token.ACTION))
