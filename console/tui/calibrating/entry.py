"""The entry of the page Calibrate: the values of a point, the path of a file, a large step typed out."""

from __future__ import annotations

from textual.widgets import Input

from profiles.fields import Field

_NUMBER_CAP_CHARACTERS = 24
_PATH_CAP_CHARACTERS = 1000


class CalibrateEntry(Input):
    """One line; hidden while nothing is typed.

    `asked` is the value that is entered, None for a path; `began` the text with which it was opened.
    """

    def __init__(self) -> None:
        super().__init__(id="calibrate-entry", compact=True, select_on_focus=False)
        self.cursor_blink = False
        self.display = False
        self.asked: Field | None = None
        self.began = ""

    @property
    def is_open(self) -> bool:
        """Whether something is typed."""
        return bool(self.display)

    def open(self, asked: Field | None, value: str = "") -> None:
        """Begin with this text, marked so that typing replaces it; the next characters are for the entry."""
        self.asked, self.began = asked, value
        self.max_length = _PATH_CAP_CHARACTERS if asked is None else _NUMBER_CAP_CHARACTERS
        self.value = value
        self.select_all()
        self.display = True
        self.keep_focus()

    def keep_focus(self) -> None:
        """Take the focus again, which a list in place of the page has taken."""
        if self.is_open and self.screen.focused is not self:
            self.screen.set_focus(self, scroll_visible=False)

    def close(self) -> None:
        """End the entry."""
        if self.is_open:
            self.display = False
            self.screen.set_focus(None)
