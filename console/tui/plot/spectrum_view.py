"""Spectrum of a part: a bar for each number of undulations per revolution, with those of the jaws marked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from console.tui.plot.canvas import DOTS_ACROSS, Floats
from console.tui.plot.cell_view import Cells, CellView
from console.tui.plot.frame import plot_frame, step_125
from console.tui.plot.trace_view import Series, TracePicture, trace_cells
from console.tui.theme import Token

LOWEST_ORDER = 2  # the order of 1 is the eccentricity
_LEAST_TOP_UM = 0.2
_BESIDE = 0.18  # fraction of an order by which the bars of two parts are apart
_HEADROOM_ROWS = 2
CUT_OFF = "↑"
"""Mark of a bar that is higher than the plot."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bars:
    """The spectrum of one part: um peak to peak by order, from order 0; thin bars are broken lines."""

    um_pp: ArrayLike
    token: Token
    thin: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectrumPicture:
    """Spectra up to the order `highest`, on a scale up to `top_um`; the last part is beside the others."""

    bars: Sequence[Bars] = ()
    highest: int = 15
    top_um: float = 1.0
    marked: Sequence[int] = ()
    unit: str = "um"
    unit_um: float = 1.0  # size of the unit of the axis


def fitting_top_um(bars: Sequence[Bars], highest: int, unit_um: float = 1.0) -> float:
    """Return the smallest height that holds all bars from order 2 on, round in units of `unit_um`."""
    tallest = [float(np.max(_values(each, highest)[LOWEST_ORDER:], initial=0.0)) for each in bars]
    return step_125((max(*tallest, _LEAST_TOP_UM) if tallest else _LEAST_TOP_UM) / unit_um) * unit_um


def spectrum_cells(picture: SpectrumPicture, columns: int, rows: int) -> Cells:
    """Return the bars over their axes for a size in cells."""
    limits, top_um = (LOWEST_ORDER - 1.0, picture.highest + 1.0), picture.top_um
    high = (
        0.0,
        top_um / picture.unit_um * (1.0 + _HEADROOM_ROWS / max(rows, 4)),
    )  # the numbers of the orders are above the bars
    series = [each for place, bars in enumerate(picture.bars) for each in _series(picture, bars, place)]
    drawn = TracePicture(series=series, x_limits=limits, y_limits=high, y_unit=picture.unit, x_unit="/rev")
    cells = trace_cells(drawn, columns, rows)
    frame = plot_frame(columns, rows, limits, high, picture.unit, "/rev")

    def column_of(order: int) -> int:
        return int(frame.to_dots([order], [0.0])[0][0]) // DOTS_ACROSS + frame.left

    for order in picture.marked:
        if LOWEST_ORDER <= order <= picture.highest:
            cells.write(0, column_of(order), str(order), Token.MARK)
    for bars in picture.bars:
        values = _values(bars, picture.highest)
        for order in (np.flatnonzero(values[LOWEST_ORDER:] > top_um * (1.0 + 1e-9)) + LOWEST_ORDER).tolist():
            cells.write(1, column_of(order), CUT_OFF, bars.token)
    return cells


def _values(bars: Bars, highest: int) -> Floats:
    """Return the heights of the orders 0 to `highest`."""
    values = np.zeros(highest + 1)
    given = np.asarray(bars.um_pp, dtype=np.float64)[: highest + 1]
    values[: given.size] = given
    return values


def _series(picture: SpectrumPicture, bars: Bars, place: int) -> list[Series]:
    """Return the bars of a part as upright lines, beside those of the others."""
    values = _values(bars, picture.highest)[LOWEST_ORDER:]
    beside = _BESIDE * (2 * place - (len(picture.bars) - 1))
    orders = np.arange(LOWEST_ORDER, picture.highest + 1) + beside
    gaps = np.full(orders.size, np.nan)
    x = np.column_stack([orders, orders, gaps]).ravel()
    y = (
        np.column_stack([np.zeros(orders.size), np.minimum(values, picture.top_um), gaps]).ravel()
        / picture.unit_um
    )
    return [Series(x=x, y=y, token=bars.token, dashed=bars.thin)]


class SpectrumView(CellView):
    """The spectra of one part or two."""

    _picture = SpectrumPicture()

    def show(self, picture: SpectrumPicture) -> None:
        """Draw these spectra instead of the last ones."""
        self._picture = picture
        self.redraw()

    @property
    def scale_um(self) -> float:
        """The height of the plot, um peak to peak."""
        return self._picture.top_um

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture of the last data for a size in cells."""
        return spectrum_cells(self._picture, columns, rows)
