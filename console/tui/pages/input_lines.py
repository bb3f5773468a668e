"""The safety devices that the controller sees, each with its state, as text. They are only shown."""

from __future__ import annotations

from rich.cells import cell_len

from console.text.catalogue import Catalogue
from console.tui.lines import Line, Piece, dim
from console.tui.theme import Token
from drivers.snapshot import Snapshot


def input_lines(text: Catalogue, snapshot: Snapshot | None, width: int, height: int | None = None) -> list[Line]:
    """Return the devices, those that are not as they must be first; nothing where there are none.

    Where not all have room, those that are well give way, and then the last.
    """
    seen = {} if snapshot is None else snapshot.inputs
    bad = [(f"✗ {text(f'run_page.input.{name}')}", Token.WARNING) for name, good in seen.items() if not good]
    well = [(f"✓ {text(f'run_page.input.{name}')}", Token.DIM) for name, good in seen.items() if good]
    rows = _in_rows([*bad, *well], width)
    return rows if height is None or len(rows) <= height else _in_rows(bad, width)[: max(height, 0)]


def _in_rows(pieces: list[Piece], width: int) -> list[Line]:
    """Set pieces beside each other, two cells apart, as many as a row takes."""
    rows: list[list[Piece]] = []
    room = 0
    for words, token in pieces:
        needs = cell_len(words) + 2
        if not rows or needs > room:
            rows.append([(words, token)])
            room = width - cell_len(words)
        else:
            rows[-1] += [dim("  "), (words, token)]
            room -= needs
    return [tuple(row) for row in rows]
