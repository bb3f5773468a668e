"""Aligned plain text in which a Hangul syllable is two cells wide."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

from console.escaping import escaped_line


def cell_width(text: str) -> int:
    """Return the width of a text in terminal cells."""
    return sum(
        0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text
    )


def pad_left(text: str, width: int) -> str:
    """Pad with spaces on the left, for numbers."""
    return " " * max(0, width - cell_width(text)) + text


def table(rows: Sequence[Sequence[str]], numeric: Sequence[int] = ()) -> list[str]:
    """Return the rows with equal column widths; `numeric` columns are right-aligned."""
    if not rows:
        return []
    rows = [[escaped_line(cell) for cell in row] for row in rows]  # a name with a line break must not start a row
    widths = [max(cell_width(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(
            pad_left(cell, width) if i in numeric else cell + " " * (width - cell_width(cell))
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def wrap_text(text: str, width: int) -> list[str]:
    """Wrap a text at spaces into lines of at most `width` cells; a longer word stays whole."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".lstrip()
        if cell_width(longer) <= width or not lines[-1]:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines
