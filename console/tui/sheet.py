"""A panel of text lines that repaints only what has changed."""

from __future__ import annotations

from collections.abc import Sequence

from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from console.text.escaping import escaped_line
from console.tui.lines import BLANK, Line, changed, to_strip
from console.tui.theme import Palette


class Sheet(Widget, can_focus=False):
    """Lines of pieces; what is longer or higher than the panel is cut off."""

    def __init__(self, palette: Palette, *, id: str | None = None, classes: str | None = None) -> None:
        super().__init__(id=id, classes=classes)
        self._palette = palette
        self._lines: tuple[Line, ...] = ()

    @property
    def lines(self) -> tuple[Line, ...]:
        """What is shown."""
        return self._lines

    def show(self, lines: Sequence[Line]) -> None:
        """Show these lines; cells that stay the same are not painted again."""
        before, self._lines = self._lines, tuple(_harmless(each) for each in lines)
        regions = []
        for row in range(max(len(before), len(self._lines))):
            if _row(before, row) != _row(self._lines, row):
                first, end = changed(_row(before, row), _row(self._lines, row))
                regions.append(Region(first, row, end - first, 1))
        if regions:
            self.refresh(*regions)

    def render_line(self, y: int) -> Strip:
        """Return one row."""
        return to_strip(_row(self._lines, y), self.size.width, self._palette)


def _harmless(pieces: Line) -> Line:
    """Return a line that cannot steer the terminal, whatever the names in it."""
    if all(text.isprintable() for text, _ in pieces):
        return pieces
    return tuple((escaped_line(text), token) for text, token in pieces)


def _row(lines: tuple[Line, ...], row: int) -> Line:
    return lines[row] if row < len(lines) else BLANK
