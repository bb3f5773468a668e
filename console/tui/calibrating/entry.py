"""The entry of the page Calibrate: the values of a point, the path of a file, a large step typed out."""

from __future__ import annotations

from console.tui.entry import NUMBER_CAP_CHARACTERS, PATH_CAP_CHARACTERS, EntryLine
from profiles.fields import Field


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
