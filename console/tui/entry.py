"""The line in which something is typed, over a panel of a page."""

from __future__ import annotations

from textual.widgets import Input
from textual.widgets.input import Selection

from profiles.fields import TEXT_CAP_CHARACTERS, Field

NUMBER_CAP_CHARACTERS = 24
PATH_CAP_CHARACTERS = 1000


class EntryLine(Input):
    """One line; hidden while nothing is typed. Nothing that is typed moves anything."""

    DEFAULT_CSS = """
    EntryLine {
        layer: entry; position: absolute; height: 1;
        background: $background; color: $foreground;
    }
    """

    def __init__(
        self, *, id: str | None = None, classes: str | None = None, cap_characters: int = TEXT_CAP_CHARACTERS
    ) -> None:
        super().__init__(id=id, classes=classes, compact=True, select_on_focus=False, max_length=cap_characters)
        self.cursor_blink = False
        self.display = False

    @property
    def is_open(self) -> bool:
        """Whether something is typed."""
        return bool(self.display)

    def begin(self, value: str = "", *, marked: bool = False) -> None:
        """Begin with this text, `marked` so that typing replaces it, else with the cursor behind it.

        The focus is taken at once, not with the next message: the characters after this key are for the entry.
        """
        self.value = value
        self.selection = Selection(0 if marked else len(value), len(value))
        self.display = True
        self.keep_focus()

    def keep_focus(self) -> None:
        """Take the focus again, which a list in place of the page has taken."""
        if self.is_open and self.screen.focused is not self:
            self.screen.set_focus(self, scroll_visible=False)

    def close(self) -> str:
        """End the entry, and return what was typed."""
        if self.is_open:
            self.display = False
            self.screen.set_focus(None)
        return self.value.strip()


class CalibrateEntry(EntryLine):
    """One line; `asked` is the value that is entered, None for a path; `began` the text it was opened with."""

    def __init__(self) -> None:
        super().__init__(id="calibrate-entry")
        self.asked: Field | None = None
        self.began = ""

    def open(self, asked: Field | None, value: str = "") -> None:
        """Begin with this text, marked so that typing replaces it."""
        self.asked, self.began = asked, value
        self.max_length = PATH_CAP_CHARACTERS if asked is None else NUMBER_CAP_CHARACTERS
        self.begin(value, marked=True)
