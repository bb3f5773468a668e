"""Run chart: a value for each part, its tolerance, the mean, and the limits beyond which it is no chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from console.tui.plot.canvas import DOTS_ACROSS, DOTS_DOWN
from console.tui.plot.cell_view import Cells, CellView
from console.tui.plot.frame import Limits, nice_limits, plot_frame
from console.tui.plot.trace_view import Series, TracePicture, trace_cells
from console.tui.theme import Token

POINT, BEYOND = "•", "✗"
CELLS_PER_POINT = 2  # columns for each part below which its point is a dot of the line
_MARGIN = 4  # columns on the right for the names of the lines


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """A horizontal line from part `begins` on, with a name of a few characters one cell wide at its right end."""

    value: float
    name: str
    token: Token
    begins: float = 0.0
    dashed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ChartPicture:
    """Values in `unit` over part numbers, the places of those `beyond` the limits, and lines."""

    numbers: Sequence[float] = ()
    values: Sequence[float] = ()
    beyond: Sequence[int] = ()
    levels: Sequence[Level] = ()
    unit: str = "um"


def chart_cells(picture: ChartPicture, columns: int, rows: int) -> Cells:
    """Return the chart for a size in cells."""
    if not picture.values:
        return Cells.blank(columns, rows)
    width = max(columns - _MARGIN, 1)
    x_limits, y_limits = _limits(picture)
    ends = [
        Series(x=(each.begins, x_limits[1]), y=(each.value,) * 2, token=each.token, dashed=each.dashed)
        for each in picture.levels
    ]
    traced = Series(x=picture.numbers, y=picture.values, token=Token.AFTER)
    drawn = TracePicture(series=(*ends, traced), x_limits=x_limits, y_limits=y_limits, y_unit=picture.unit)
    plotted = trace_cells(drawn, width, rows)
    cells = Cells.blank(columns, rows)
    cells.codes[:, :width], cells.tokens[:, :width] = plotted.codes, plotted.tokens
    frame = plot_frame(width, rows, x_limits, y_limits, picture.unit)
    x, y = frame.to_dots(picture.numbers, picture.values)
    roomy = len(picture.values) * CELLS_PER_POINT <= frame.data_columns
    for place, (across, down) in enumerate(zip(x, y, strict=True)):
        is_beyond = place in picture.beyond
        if roomy or is_beyond:
            row, column = _cell(down, DOTS_DOWN), frame.left + _cell(across, DOTS_ACROSS)
            mark, token = (BEYOND, Token.WARNING) if is_beyond else (POINT, Token.AFTER)
            cells.write(row, column, mark, token)
    for level in picture.levels:
        _, down = frame.to_dots([x_limits[1]], [level.value])
        cells.write(_cell(down[0], DOTS_DOWN), width, f" {level.name}"[:_MARGIN], level.token)
    return cells


def _limits(picture: ChartPicture) -> tuple[Limits, Limits]:
    shown = [*picture.values, *(level.value for level in picture.levels)]
    first, last = float(picture.numbers[0]), float(picture.numbers[-1])
    return (first - 0.5, last + 0.5), nice_limits(min(shown), max(shown))


def _cell(dot: float, size: int) -> int:
    return int(np.floor(dot + 0.5)) // size


class RunChartView(CellView):
    """The chart of some parts."""

    _picture = ChartPicture()

    def show(self, picture: ChartPicture) -> None:
        """Draw this chart instead of the last one."""
        self._picture = picture
        self.redraw()

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture for a size in cells."""
        return chart_cells(self._picture, columns, rows)
