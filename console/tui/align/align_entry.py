"""The entry of the page Align: one number, over the panel that says how it is understood."""

from __future__ import annotations

from console.tui.align.asked import ENTRY_WIDTH, Asked
from console.tui.entry import EntryLine

_CAP_CHARACTERS = 12


class AlignEntry(EntryLine):
    """One number; `asked` says which."""

    DEFAULT_CSS = f"AlignEntry {{ width: {ENTRY_WIDTH}; }}"

    def __init__(self) -> None:
        super().__init__(id="align-entry", cap_characters=_CAP_CHARACTERS)
        self.asked = Asked.NOTHING

    def open(self, asked: Asked) -> None:
        """Ask for a number."""
        self.asked = asked
        self.begin()

    def close(self) -> str:
        """Ask for nothing more; what was typed is forgotten."""
        typed = super().close()
        self.asked, self.value = Asked.NOTHING, ""
        return typed
