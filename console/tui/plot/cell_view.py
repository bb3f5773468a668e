"""Common widget of both plots: it keeps a picture of cells and sends only what changed."""

from __future__ import annotations

from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from console.tui.plot.canvas import Glyphs
from console.tui.plot.spans import Brush, Cells, changed_spans
from console.tui.theme import COLOUR, Palette, Token


class CellView(Widget):
    """A picture drawn by `draw` for the size that the widget has.

    Args:
        palette: The styles of the tokens.
        glyphs: How dots are written; "ascii" for fonts without braille.
        id: The name of the widget for style sheets and queries.
        classes: Its style classes.
    """

    can_focus = False
    DEFAULT_CSS = "CellView { width: 1fr; height: 1fr; }"

    def __init__(
        self,
        *,
        palette: Palette = COLOUR,
        glyphs: Glyphs = "braille",
        id: str | None = None,  # Textual's own name for it
        classes: str | None = None,
    ) -> None:
        super().__init__(id=id, classes=classes)
        self.glyphs: Glyphs = glyphs
        self._blank = palette.style(Token.TEXT)
        self._brush = Brush.of(palette)
        self._cells = Cells.blank(1, 1)

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture for a size in cells; each plot has its own."""
        return Cells.blank(columns, rows)

    def redraw(self) -> None:
        """Draw again and send the changed spans; everything after a change of size."""
        old = self._cells
        self._cells = new = self.draw(*self._room)
        if (old.columns, old.rows) != (new.columns, new.rows):
            self.refresh()
            return
        spans = changed_spans(old, new)
        if spans:
            self.refresh(*(Region(span.start, span.row, span.end - span.start, 1) for span in spans))

    def render_line(self, y: int) -> Strip:
        """Return one line; draw the last data here after a change of size."""
        if (self._cells.columns, self._cells.rows) != self._room:
            self._cells = self.draw(*self._room)
        width = self.size.width
        if not 0 <= y < self._cells.rows:
            return Strip.blank(width, self._blank)
        return self._brush.strip(self._cells, y).adjust_cell_length(width, self._blank)

    @property
    def _room(self) -> tuple[int, int]:
        return max(self.size.width, 1), max(self.size.height, 1)
