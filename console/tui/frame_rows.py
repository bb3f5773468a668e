"""The six rows of the frame on the screen: each sheet is as high as its message needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from console.tui.frame import ROWS
from console.tui.lines import Line, Sheet
from console.tui.theme import Palette


class FrameRows:
    """The sheets of the rows, by name; those of `ABOVE` are over the page, those of `BELOW` under it."""

    ABOVE = ("state", "alarm", "pages")
    BELOW = ("next", "stop", "keys")

    def __init__(self, palette: Palette) -> None:
        self._sheets = {name: Sheet(palette, id=f"row-{name}", classes="row") for name in ROWS}

    def __getitem__(self, name: str) -> Sheet:
        return self._sheets[name]

    def named(self, names: Sequence[str]) -> list[Sheet]:
        """Return the sheets of these rows."""
        return [self._sheets[name] for name in names]

    def show(self, rows: Mapping[str, Sequence[Line]]) -> bool:
        """Show the lines; return whether a longer or shorter message changes the size of the page."""
        moved = False
        for name, lines in rows.items():
            sheet = self._sheets[name]
            if len(lines) != max(len(sheet.lines), 1):
                sheet.styles.height = len(lines)
                moved = True
            sheet.show(lines)
        return moved
