"""The entry of the page Jobs: a search, a name, a note, tags or a path."""

from __future__ import annotations

from enum import StrEnum

from textual.widgets import Input
from textual.widgets.input import Selection

from profiles.fields import TEXT_CAP_CHARACTERS

_PATH_CAP_CHARACTERS = 1000


class Typing(StrEnum):
    """What is typed."""

    NOTHING = "nothing"
    SEARCH = "search"
    NAME = "name"
    NOTE = "note"
    TAGS = "tags"
    PATH = "path"


class JobsEntry(Input):
    """One line of free text over the heading of the list; hidden while nothing is typed."""

    DEFAULT_CSS = """
    JobsEntry {
        layer: entry; position: absolute; display: none; width: 50%; height: 1; offset: 3 1;
        background: $background; color: $foreground;
    }
    """

    def __init__(self) -> None:
        super().__init__(id="jobs-entry", compact=True, select_on_focus=False)
        self.cursor_blink = False
        self.typing = Typing.NOTHING

    def open(self, typing: Typing, value: str) -> None:
        """Begin with this text, the cursor behind it; the next characters are for the entry.

        The words of a search are selected: a character begins another search, an arrow key keeps them.
        """
        self.typing = typing
        self.max_length = _PATH_CAP_CHARACTERS if typing is Typing.PATH else TEXT_CAP_CHARACTERS
        self.value = value
        begin = 0 if typing is Typing.SEARCH else len(value)
        self.selection = Selection(begin, len(value))
        self.display = True
        self.keep_focus()

    def keep_focus(self) -> None:
        """Take the focus again, which a list in place of the page has taken."""
        if self.typing is not Typing.NOTHING and self.screen.focused is not self:
            self.screen.set_focus(self, scroll_visible=False)

    def close(self) -> str:
        """End the entry, and return what was typed."""
        typed = self.value.strip()
        if self.typing is not Typing.NOTHING:
            self.typing = Typing.NOTHING
            self.display = False
            self.screen.set_focus(None)
        return typed
