"""`console reproduce --plot`: the figures of the paper as text, without colours and without a screen."""

from __future__ import annotations

import shutil
from argparse import Namespace

import numpy as np

from console.cli.measured.comparison import reproduce, word
from console.text.catalogue import Catalogue
from console.tui.plot.frame import Limits, nice_limits
from console.tui.plot.trace_view import Series, TracePicture, trace_cells
from console.tui.theme import Token
from profiles.paper.record import Figure

MOST_COLUMNS, ROWS = 90, 14
_MARKS = ("──", "╌╌", "··")  # the first curve is a line, the second a broken one, the third dots


def main(options: Namespace, text: Catalogue) -> int:
    """Print the comparison with its figures; 1 where an acceptance number is missed."""
    columns = min(MOST_COLUMNS, shutil.get_terminal_size().columns)
    return reproduce(options, text, lambda figure: figure_lines(figure, text, columns))


def figure_lines(figure: Figure, text: Catalogue, columns: int = MOST_COLUMNS, rows: int = ROWS) -> list[str]:
    """Return a figure with its legend."""
    across = np.concatenate([curve.x for curve in figure.curves])
    up = np.concatenate([curve.y for curve in figure.curves])
    series = [
        Series(x=curve.x, y=curve.y, token=Token.TEXT, dashed=place == 1, dots=place > 1)
        for place, curve in enumerate(figure.curves)
    ]
    picture = TracePicture(
        series=series,
        x_limits=_x_limits(float(across.min()), float(across.max())),
        y_limits=nice_limits(float(up.min()), float(up.max())),
        y_unit=figure.y_unit,
        x_unit=figure.x_unit,
    )
    drawn = [row.rstrip() for row in trace_cells(picture, columns, rows).text_rows()]
    legend = "   ".join(
        f"{mark} {word(curve.name, text)}" for mark, curve in zip(_MARKS, figure.curves, strict=False)
    )
    return [*drawn, f"    {legend}"]


def _x_limits(low: float, high: float) -> Limits:
    """Return a whole turn where the points are nearly one, else round numbers."""
    return (0.0, 360.0) if low == 0.0 and 359.0 <= high <= 360.0 else nice_limits(low, high)
