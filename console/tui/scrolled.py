"""Scrollable panel with more lines than rows: keys scroll it, and its last row says so."""

from __future__ import annotations

from collections.abc import Sequence

from console.text.catalogue import Catalogue
from console.tui.lines import Line, Sheet, dim, line
from console.tui.theme import Palette


class ScrolledSheet(Sheet):
    """Lines in place of the page: key lists, messages in full. `scroll` moves through them."""

    def __init__(self, palette: Palette, text: Catalogue, *, id: str | None = None) -> None:
        super().__init__(palette, id=id)
        self._text = text
        self._rows: tuple[Line, ...] = ()
        self._first = 0

    def begin(self) -> None:
        """Scroll to the top."""
        self._first = 0

    def scroll(self, halves: int) -> None:
        """Scroll by so many halves of the height, downwards positive."""
        self._first += halves * max(self.size.height // 2, 1)
        self.lay(self._rows)

    def lay(self, rows: Sequence[Line]) -> None:
        """Show these lines, as many as fit."""
        self._rows = tuple(rows)
        height = max(self.size.height, 1)
        if len(rows) <= height:
            self._first = 0
            self.show(rows)
            return
        room = max(height - 1, 1)
        self._first = min(max(self._first, 0), len(rows) - room)
        last = self._first + room
        foot = self._text("scrolled.rows", first=self._first + 1, last=last, all=len(rows))
        self.show([*rows[self._first : last], line(dim(foot))])
