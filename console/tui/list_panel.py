"""What takes the place of the page while it is read: the lists of keys, or every message in full."""

from __future__ import annotations

from collections.abc import Sequence

from console.text.catalogue import Catalogue
from console.tui.frame import Frame
from console.tui.keymap import LISTS, Action, help_lines
from console.tui.lines import Line
from console.tui.messages import message_lines
from console.tui.scrolled import ScrolledSheet
from console.tui.theme import Palette

PAGE, MESSAGES = 0, -1
"""What is shown beside the numbers of the lists of keys, from 1: the page itself, or the messages."""


class ListPanel(ScrolledSheet):
    """One of the lists; `shown` is which, `PAGE` while the page is seen."""

    def __init__(self, palette: Palette, text: Catalogue) -> None:
        super().__init__(palette, text, id="list")
        self._words, self.shown = text, PAGE

    @property
    def is_open(self) -> bool:
        """Whether a list is in the place of the page."""
        return self.shown != PAGE

    def open(self, number: int) -> None:
        """Show one of the lists of keys, or the messages, from its beginning; `PAGE` shows the page again."""
        self.shown = number
        self.begin()
        self.screen.set_class(self.is_open, "reading")

    def step(self) -> None:
        """Show the next list of keys, and the page after the last."""
        self.open((max(self.shown, 0) + 1) % (LISTS + 1))

    def read(self, action: Action) -> None:
        """Open or close the messages, or scroll the list that is open."""
        if action.id == "messages":
            self.open(PAGE if self.shown == MESSAGES else MESSAGES)
        else:
            self.scroll(1 if action.id == "list.down" else -1)

    def lay_open(self, frame: Frame, of_page: Sequence[Line], width: int) -> None:
        """Lay out the list that is open, for a view of the machine; `of_page` is what the page says in full."""
        if self.shown == MESSAGES:
            self.lay(message_lines(frame, of_page, width))
        else:
            self.lay(help_lines(frame.text, frame.page, self.shown, width))
