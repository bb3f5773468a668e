"""The entry of the page Align: one number, over the panel that says how it is understood."""

from __future__ import annotations

from textual.widgets import Input

from console.tui.align.asked import ENTRY_WIDTH, Asked

_CAP_CHARACTERS = 12


class AlignEntry(Input):
    """One number; hidden while none is asked for. Nothing that is typed moves anything."""

    DEFAULT_CSS = f"""
    AlignEntry {{
        layer: entry; position: absolute; display: none; width: {ENTRY_WIDTH}; height: 1;
        background: $background; color: $foreground;
    }}
    """

    def __init__(self) -> None:
        super().__init__(id="align-entry", compact=True, select_on_focus=False, max_length=_CAP_CHARACTERS)
        self.cursor_blink = False
        self.asked = Asked.NOTHING

    def open(self, asked: Asked) -> None:
        """Ask for a number; the next characters are for the entry."""
        self.asked = asked
        self.value = ""
        self.display = True
        self.keep_focus()

    def keep_focus(self) -> None:
        """Take the focus again, which a list in place of the page has taken."""
        if self.asked is not Asked.NOTHING and self.screen.focused is not self:
            self.screen.set_focus(self, scroll_visible=False)

    def close(self) -> None:
        """Ask for nothing more; what was typed is forgotten."""
        if self.asked is not Asked.NOTHING:
            self.asked = Asked.NOTHING
            self.value = ""
            self.display = False
            self.screen.set_focus(None)
