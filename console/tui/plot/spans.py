"""Picture of cells, the difference between two of them, and the strips that Textual draws."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

from console.tui.plot.canvas import NO_LAYER, BrailleCanvas
from console.tui.theme import Palette, Token

BLANK = ord(" ")
UNKNOWN = "?"


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Cells of one row, from `start` up to but excluding `end`."""

    row: int
    start: int
    end: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Characters with their tokens, rows x columns; every character is one cell wide."""

    codes: NDArray[np.uint32]
    tokens: NDArray[np.uint8]
    """The value of the `Token` of each cell."""

    @classmethod
    def blank(cls, columns: int, rows: int) -> Cells:
        """Return an empty picture of at least one cell."""
        shape = (max(rows, 1), max(columns, 1))
        return cls(
            codes=np.full(shape, BLANK, dtype=np.uint32),
            tokens=np.full(shape, Token.TEXT.value, dtype=np.uint8),
        )

    @property
    def columns(self) -> int:
        """The width in cells."""
        return int(self.codes.shape[1])

    @property
    def rows(self) -> int:
        """The height in cells."""
        return int(self.codes.shape[0])

    def copy(self) -> Cells:
        """Return an independent copy to draw on."""
        return Cells(codes=self.codes.copy(), tokens=self.tokens.copy())

    def write(self, row: int, column: int, text: str, token: Token) -> None:
        """Write text into the picture; what falls outside is left out.

        A character that is not exactly one cell wide becomes "?", because it would shift the rest of its row.
        """
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


def changed_spans(old: Cells, new: Cells) -> list[Span]:
    """Return what must be drawn again: one span for each row with changes of character or token.

    One and not several, because Textual writes a row from the edge of the widget up to the end of each span:
    every further span of a row would repeat what is before it.
    """
    changed = (old.codes != new.codes) | (old.tokens != new.tokens)
    spans = []
    for row in np.flatnonzero(changed.any(axis=1)):
        places = np.flatnonzero(changed[row])
        spans.append(Span(row=int(row), start=int(places[0]), end=int(places[-1]) + 1))
    return spans


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Brush:
    """A palette prepared for many strips."""

    styles: tuple[Style, ...]
    """By the value of the token."""
    runs_on: NDArray[np.bool_]
    """Whether a blank in this style looks like any other blank."""

    @classmethod
    def of(cls, palette: Palette) -> Brush:
        """Return the brush of a palette."""
        styles = [palette.style(Token.TEXT)] * (max(token.value for token in Token) + 1)
        for token in Token:
            styles[token.value] = palette.style(token)
        background = palette.style(Token.TEXT).bgcolor
        runs_on = [
            style.bgcolor == background and not (style.strike or style.reverse or style.underline)
            for style in styles
        ]
        return cls(styles=tuple(styles), runs_on=np.array(runs_on, dtype=np.bool_))

    def strip(self, cells: Cells, row: int) -> Strip:
        """Return one row as Textual draws it, always with styles: without one it may crash."""
        codes = cells.codes[row]
        tokens = self._over_blanks(codes != BLANK, cells.tokens[row])
        starts = [0, *(np.flatnonzero(tokens[1:] != tokens[:-1]) + 1).tolist(), tokens.size]
        text = codes.astype("<u4").tobytes().decode("utf-32-le")
        segments = [Segment(text[start:end], self.styles[tokens[start]]) for start, end in pairwise(starts)]
        return Strip(segments, cells.columns)

    def _over_blanks(self, drawn: NDArray[np.bool_], tokens: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Give blanks the style of what precedes them: each change of style is 40 bytes to the terminal."""
        if not drawn.any():
            return tokens
        nearest = np.maximum.accumulate(np.where(drawn, np.arange(drawn.size), int(drawn.argmax())))
        lent = tokens[nearest]
        return np.where(self.runs_on[lent] & self.runs_on[tokens], lent, tokens)
