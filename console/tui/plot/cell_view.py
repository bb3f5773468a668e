"""Picture of cells, and the widget of both plots, which sends only the cells that changed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray
from rich.cells import cell_len
from rich.segment import Segment
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from console.tui.plot.canvas import NO_LAYER, BrailleCanvas
from console.tui.theme import COLOUR, Palette, Token

BLANK = ord(" ")
UNKNOWN = "?"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Characters with their tokens, rows x columns; every character is one cell wide."""

    codes: NDArray[np.uint32]
    tokens: NDArray[np.uint8]  # the value of the `Token` of each cell

    @classmethod
    def blank(cls, columns: int, rows: int) -> Self:
        """Return an empty picture of at least one cell."""
        shape = (max(rows, 1), max(columns, 1))
        tokens = np.full(shape, Token.TEXT.value, dtype=np.uint8)
        return cls(codes=np.full(shape, BLANK, dtype=np.uint32), tokens=tokens)

    @property
    def columns(self) -> int:
        """The width in cells."""
        return int(self.codes.shape[1])

    @property
    def rows(self) -> int:
        """The height in cells."""
        return int(self.codes.shape[0])

    def write(self, row: int, column: int, text: str, token: Token) -> None:
        """Write text into the picture, as far as it is inside; a character not one cell wide becomes "?"."""
        if not 0 <= row < self.rows:
            return
        for place, character in enumerate(text, start=column):
            if 0 <= place < self.columns:
                self.codes[row, place] = ord(character if cell_len(character) == 1 else UNKNOWN)
                self.tokens[row, place] = token.value

    def lay(self, canvas: BrailleCanvas, top: int, left: int, tokens: tuple[Token, ...]) -> None:
        """Lay the dots of a canvas over the picture; `tokens` has one token for each of its layers."""
        area = (slice(top, top + canvas.rows), slice(left, left + canvas.columns))
        layers = canvas.cell_layers()
        drawn = layers != NO_LAYER
        values = np.array([token.value for token in tokens], dtype=np.uint8)
        self.codes[area][drawn] = canvas.cell_codes()[drawn]
        self.tokens[area][drawn] = values[layers[drawn]]

    def text_rows(self) -> list[str]:
        """Return the characters of the rows from the top."""
        return [row.tobytes().decode("utf-32-le") for row in self.codes.astype("<u4")]


def changed_spans(old: Cells, new: Cells) -> list[Region]:
    """Return what must be drawn again: one span for each row with changes of character or token.

    One and not several, because Textual writes a row from the edge of the widget up to the end of each span:
    every further span of a row would repeat what is before it.
    """
    changed = (old.codes != new.codes) | (old.tokens != new.tokens)
    spans = []
    for row in np.flatnonzero(changed.any(axis=1)).tolist():
        places = np.flatnonzero(changed[row])
        first, last = int(places[0]), int(places[-1])
        spans.append(Region(first, row, last + 1 - first, 1))
    return spans


class Brush:
    """A palette prepared for many strips."""

    def __init__(self, palette: Palette) -> None:
        blank = palette[Token.TEXT]
        self.styles = {token.value: palette[token] for token in Token}
        # Whether a blank in the style of a token looks like any other blank.
        self._alike = np.zeros(max(self.styles) + 1, dtype=np.bool_)
        for value, style in self.styles.items():
            decorated = style.strike or style.reverse or style.underline
            self._alike[value] = style.bgcolor == blank.bgcolor and not decorated

    def strip(self, cells: Cells, row: int) -> Strip:
        """Return one row as Textual draws it, always with styles: without one it may crash."""
        codes = cells.codes[row]
        tokens = self._over_blanks(codes != BLANK, cells.tokens[row])
        starts = [0, *(np.flatnonzero(tokens[1:] != tokens[:-1]) + 1).tolist(), tokens.size]
        text = codes.astype("<u4").tobytes().decode("utf-32-le")
        segments = [Segment(text[start:end], self.styles[int(tokens[start])]) for start, end in pairwise(starts)]
        return Strip(segments, cells.columns)

    def _over_blanks(self, drawn: NDArray[np.bool_], tokens: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Give blanks the style of what precedes them: each change of style is 40 bytes to the terminal."""
        if not drawn.any():
            return tokens
        nearest = np.maximum.accumulate(np.where(drawn, np.arange(drawn.size), int(drawn.argmax())))
        lent = tokens[nearest]
        return np.where(self._alike[lent] & self._alike[tokens], lent, tokens)


class CellView(Widget):
    """A picture drawn by `draw` for the size that the widget has."""

    can_focus = False
    DEFAULT_CSS = "CellView { width: 1fr; height: 1fr; }"

    def __init__(self, *, palette: Palette = COLOUR, id: str | None = None, classes: str | None = None) -> None:
        super().__init__(id=id, classes=classes)
        self._palette = palette
        self._blank = palette[Token.TEXT]
        self._brush = Brush(palette)
        self._cells = Cells.blank(1, 1)

    def notify_style_update(self) -> None:
        """Take the colours anew where the theme has changed."""
        super().notify_style_update()
        if self._palette[Token.TEXT] is not self._blank:
            self._blank, self._brush = self._palette[Token.TEXT], Brush(self._palette)

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture for a size in cells; each plot has its own."""
        return Cells.blank(columns, rows)

    def redraw(self) -> None:
        """Draw again and send the changed spans; everything after a change of size."""
        old = self._cells
        self._cells = new = self.draw(*self._room)
        if (old.columns, old.rows) != (new.columns, new.rows):
            self.refresh()
        elif spans := changed_spans(old, new):
            self.refresh(*spans)

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
