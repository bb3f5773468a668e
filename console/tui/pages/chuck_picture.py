"""Front view of the chuck, as seen at the lathe: rim, jaws, and the mark that jaw 1 must meet."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from console.tui.lines import Line, Piece
from console.tui.plot.canvas import BrailleCanvas
from console.tui.theme import Token

LEAST_ROWS, LEAST_COLUMNS = 4, 9

_RIM, _JAW, _JAW_1 = 0, 1, 2
_TOKENS = {-1: Token.TEXT, _RIM: Token.RING, _JAW: Token.AXIS, _JAW_1: Token.MARK}
_JAW_SHARE = 0.5
"""Fraction of the radius to which a jaw reaches from the rim."""
_BESIDE = 3
"""Columns to the right of the rim, for the mark."""


@lru_cache(maxsize=4)
def chuck_lines(columns: int, rows: int, jaws: int, jaw_1_past_mark_deg: float) -> tuple[Line, ...]:
    """Return the picture in so many cells, none where it would be too small to be useful.

    The mark is at 3 o'clock and angles are counter-clockwise; jaw 1 is the bold one with its number.
    """
    if columns < LEAST_COLUMNS or rows < LEAST_ROWS:
        return ()
    canvas = BrailleCanvas(columns, rows)
    centre_x, centre_y = columns - 1.0, 2.0 * rows - 0.5
    radius = min(centre_y, centre_x - 2.0 * _BESIDE)
    turn = np.radians(np.arange(0.0, 361.0, 3.0))
    canvas.polyline(centre_x + radius * np.cos(turn), centre_y - radius * np.sin(turn), _RIM)
    for jaw in reversed(range(jaws)):
        angle = math.radians(jaw_1_past_mark_deg + 360.0 * jaw / jaws)
        reach = np.array([_JAW_SHARE * radius, radius - 1.0])
        layer = _JAW_1 if jaw == 0 else _JAW
        for shift in (-1.0, 0.0, 1.0):
            x = centre_x + reach * math.cos(angle) - shift * math.sin(angle)
            y = centre_y - reach * math.sin(angle) - shift * math.cos(angle)
            canvas.polyline(x, y, layer)
    characters = [list(row) for row in canvas.text_rows()]
    layers = canvas.cell_layers()
    _write_number(characters, layers, centre_x, centre_y, 0.3 * radius, math.radians(jaw_1_past_mark_deg))
    row, column = int(centre_y // 4), int((centre_x + radius) // 2) + 1
    characters[row][column] = "◂"
    layers[row, column] = _JAW_1
    return tuple(_line(texts, levels) for texts, levels in zip(characters, layers.tolist(), strict=True))


def _write_number(
    characters: list[list[str]], layers: NDArray[np.int16], x: float, y: float, radius: float, angle: float
) -> None:
    """Write the 1 at the inner end of jaw 1."""
    row = int((y - radius * math.sin(angle)) // 4)
    column = int((x + radius * math.cos(angle)) // 2)
    characters[row][column] = "1"
    layers[row, column] = _JAW_1


def _line(characters: list[str], layers: list[int]) -> Line:
    pieces: list[Piece] = []
    for token, cells in groupby(zip(characters, layers, strict=True), key=lambda cell: _TOKENS[cell[1]]):
        pieces.append(("".join(character for character, _ in cells), token))
    return tuple(pieces)
