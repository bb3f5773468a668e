"""Trace plots over an axis: tool error against spindle angle, position against time."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from console.tui.plot.canvas import DOTS_ACROSS, DOTS_DOWN, BrailleCanvas, Dash
from console.tui.plot.cell_view import Cells, CellView
from console.tui.plot.frame import FRAMES_KEPT, Limits, PlotFrame, plot_frame
from console.tui.theme import Token

DASH = Dash(on=2, off=4)
"""Spaced dots, distinct even where a line is steep, so that a trace is recognised without its colour."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """One trace in the units of the axes; values that are not numbers leave gaps."""

    x: ArrayLike
    y: ArrayLike
    token: Token
    dots: bool = False  # single dots instead of a line: for many turns over each other
    dashed: bool = False  # a broken line, so that it differs from another without colour


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointMarks:
    """Single points that are drawn as one character each, over all traces."""

    x: ArrayLike
    y: ArrayLike
    sign: str
    token: Token


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TracePicture:
    """Input of a trace plot, apart from its size. A full turn (0 to 360) is divided by the jaws."""

    series: Sequence[Series] = ()
    x_limits: Limits = (0.0, 1.0)
    y_limits: Limits = (0.0, 1.0)  # `nice_limits` has round ones that keep still
    y_unit: str = ""
    x_unit: str = ""
    decades: bool = False  # the x are logarithms to the base 10
    marks: Sequence[PointMarks] = ()


def trace_cells(picture: TracePicture, columns: int, rows: int) -> Cells:
    """Return the traces over their axes for a size in cells; later traces lie over earlier ones.

    Without anything to draw there are no axes either: their numbers would mean nothing.
    """
    if not picture.series and not picture.marks:
        return Cells.blank(columns, rows)
    x_limits, y_limits = picture.x_limits, picture.y_limits
    frame = plot_frame(columns, rows, x_limits, y_limits, picture.y_unit, picture.x_unit, decades=picture.decades)
    cells = deepcopy(_axes(frame))
    canvas = BrailleCanvas(frame.data_columns, frame.data_rows)
    for layer, series in enumerate(picture.series):
        x, y = frame.to_dots(series.x, series.y)
        if series.dots:
            canvas.points(x, y, layer)
        else:
            canvas.polyline(x, y, layer, DASH if series.dashed else None)
    cells.lay(canvas, 0, frame.left, tuple(series.token for series in picture.series))
    for mark in picture.marks:
        x, y = frame.to_dots(mark.x, mark.y)
        for across, down in zip(np.atleast_1d(x), np.atleast_1d(y), strict=True):
            row, column = _cell(down, DOTS_DOWN), _cell(across, DOTS_ACROSS)
            if 0 <= row < frame.data_rows and 0 <= column < frame.data_columns:
                cells.write(row, frame.left + column, mark.sign, mark.token)
    return cells


def _cell(dot: float, size: int) -> int:
    return int(np.floor(dot + 0.5)) // size


@lru_cache(maxsize=FRAMES_KEPT)
def _axes(frame: PlotFrame) -> Cells:
    cells = Cells.blank(len(frame.rows[0]), len(frame.rows))
    for row, text in enumerate(frame.rows):
        cells.write(row, 0, text, Token.AXIS)
    return cells


class TraceView(CellView):
    """Traces over fixed axes; an update costs only what has changed."""

    _picture = TracePicture()

    def show(self, picture: TracePicture) -> None:
        """Draw these traces instead of the last ones; the last trace lies on top."""
        self._picture = deepcopy(picture)  # the caller may reuse its arrays
        self.redraw()

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture of the last data for a size in cells."""
        return trace_cells(self._picture, columns, rows)
