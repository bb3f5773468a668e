"""How long an armed cut may be started: as long as reading its summary takes, by the words on the screen."""

from __future__ import annotations

from collections.abc import Sequence

from rich.cells import cell_len

from console.session.station.commands import LEAST_ARMED_S, MOST_ARMED_S
from console.tui.lines import Line

CELLS_A_SECOND = 12.0
"""Reading slowly, as figures are compared: 140 English words, or 330 Korean syllables, a minute."""

FIND_S = 5.0  # to look from the key to the summary, and back to the key


def reading_s(rows: Sequence[Line]) -> float:
    """Return how long these rows take to read, s, between the bounds of an arming."""
    cells = sum(cell_len("".join(piece.split())) for row in rows for piece, _ in row)
    return min(max(FIND_S + cells / CELLS_A_SECOND, LEAST_ARMED_S), MOST_ARMED_S)
