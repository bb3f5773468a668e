"""Axes of a plot with their ticks on round numbers, by plotext, and the area of the data inside them.

The only module that imports plotext. It draws the frame once for each size and limits; the data are drawn on a
canvas (`BrailleCanvas`) over it, because plotext takes some ten milliseconds and leaves gaps where traces cross.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from textual_plotext import Plot

from console.tui.plot.canvas import DOTS_ACROSS, DOTS_DOWN, Floats

_FULL_TURN = (0.0, 360.0)
_FULL_TURN_TICKS = (0.0, 120.0, 240.0, 360.0)
_ROWS_PER_TICK = 3
_COLUMNS_PER_TICK = 12
_LEAST_COLUMNS = 4  # with fewer columns or rows of data than these, the axes are left out
_LEAST_ROWS = 2
_CORNER = "└"
FRAMES_KEPT = 16  # enough for every plot of the screens at one size
_ROUND = (1.0, 2.0, 5.0, 10.0)
_SLACK = 1.0e-9  # tolerance for a step to count as reached: sums of decimal steps are not exact
Limits = tuple[float, float]


def step_125(at_least: float) -> float:
    """Return the smallest step of 1, 2 or 5 times a power of ten that is not below a positive number."""
    power = 10.0 ** math.floor(math.log10(at_least))
    return next((power * step for step in _ROUND if power * step >= at_least * (1.0 - _SLACK)), 10.0 * power)


def coarser(step: float) -> float:
    """Return the next larger step of 1, 2, 5."""
    return step_125(step * 1.01)


def stepped_125(step: float, by: int) -> float:
    """Return the step of 1, 2, 5 that is so many steps above one of them, below it where `by` is negative."""
    power = round(math.log10(step / _mantissa(step)))
    places = 3 * power + _ROUND.index(_mantissa(step)) + by
    return float(_ROUND[places % 3] * 10.0 ** (places // 3))


def _mantissa(step: float) -> float:
    scaled = step / 10.0 ** math.floor(math.log10(step) + _SLACK)
    return min(_ROUND[:3], key=lambda each: abs(each - scaled))


def nice_limits(low: float, high: float) -> Limits:
    """Return limits of an axis on round numbers that hold both values, steady while the data vary a little."""
    low, high = proper_limits((low, high))
    step = step_125((high - low) / 4.0)
    bottom = math.floor(low / step + _SLACK) * step
    top = math.ceil(high / step - _SLACK) * step
    return bottom, top


def proper_limits(limits: Limits) -> Limits:
    """Return finite limits in rising order with room between them."""
    low, high = (value if math.isfinite(value) else 0.0 for value in limits)
    low, high = min(low, high), max(low, high)
    # Two limits that a float can hardly distinguish leave no room for a scale.
    room = 1.0e-9 * max(abs(low), abs(high), 1.0)
    return (low, high) if high - low > room else (low - 0.5 * max(abs(low), 1.0), high + 0.5 * max(abs(high), 1.0))


def ticks(limits: Limits, most: int) -> tuple[float, ...]:
    """Return two or more, at most `most` (at least 2), round values within proper limits."""
    low, high = limits
    step = step_125((high - low) / (max(most, 2) + 1))
    denser = found = _multiples(low, high, step)
    while len(found) > max(most, 2):
        step, denser = coarser(step), found
        found = _multiples(low, high, step)
    return found if len(found) > 1 else (denser[0], denser[-1])


def decade_ticks(limits: Limits, most: int) -> tuple[float, ...]:
    """Return logarithms of round values within limits that are logarithms to the base 10: 1, 2, 5, or 1 alone."""
    low, high = limits
    powers = range(math.floor(low), math.ceil(high) + 1)
    found: tuple[float, ...] = ()
    for steps in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        places = [power + math.log10(step) for power in powers for step in steps]
        found = tuple(place for place in places if low - _SLACK <= place <= high + _SLACK)
        if len(found) <= most + 1:
            break
    return found if len(found) > 1 else (low, high)


def _multiples(low: float, high: float, step: float) -> tuple[float, ...]:
    first, last = math.ceil(low / step - _SLACK), math.floor(high / step + _SLACK)
    return tuple(count * step for count in range(first, last + 1))


def label(value: float) -> str:
    """Return a tick's value in few characters."""
    text = f"{value:.6g}"
    return "0" if text == "-0" else text


@dataclass(frozen=True, slots=True, kw_only=True)
class PlotFrame:
    """Rows of text with axes and ticks, and the rectangle of cells for the data."""

    rows: tuple[str, ...]
    left: int
    data_columns: int
    data_rows: int
    x_limits: Limits
    y_limits: Limits

    def to_dots(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Return points as dots from the top left corner; the limits lie in the middle of the outermost dots."""
        across = _fraction(x, self.x_limits) * (self.data_columns * DOTS_ACROSS - 1)
        up = _fraction(y, self.y_limits) * (self.data_rows * DOTS_DOWN - 1)
        return across, (self.data_rows * DOTS_DOWN - 1) - up


def _fraction(values: ArrayLike, limits: Limits) -> Floats:
    fraction: Floats = (np.asarray(values, dtype=np.float64) - limits[0]) / (limits[1] - limits[0])
    return fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class _FrameAxis:
    limits: Limits
    ticks: tuple[float, ...]
    labels: tuple[str, ...]

    @classmethod
    def along_decades(cls, limits: Limits, columns: int, unit: str) -> Self:
        places = decade_ticks(limits, columns // _COLUMNS_PER_TICK + 1)
        labels = [label(10.0**place) for place in places]
        return cls(limits=limits, ticks=places, labels=(*labels[:-1], _with_x_unit(labels[-1], unit)))

    @classmethod
    def along_x(cls, limits: Limits, columns: int, unit: str) -> Self:
        places = _FULL_TURN_TICKS if limits == _FULL_TURN else ticks(limits, columns // _COLUMNS_PER_TICK + 1)
        labels = [label(place) for place in places]
        return cls(limits=limits, ticks=places, labels=(*labels[:-1], _with_x_unit(labels[-1], unit)))

    @classmethod
    def along_y(cls, limits: Limits, rows: int, unit: str) -> Self:
        places = ticks(limits, rows // _ROWS_PER_TICK + 1)
        return cls(limits=limits, ticks=places, labels=tuple(label(place).rjust(len(unit)) for place in places))


@lru_cache(maxsize=FRAMES_KEPT)
def plot_frame(
    columns: int,
    rows: int,
    x_limits: Limits,
    y_limits: Limits,
    y_unit: str = "",
    x_unit: str = "",
    *,
    decades: bool = False,
) -> PlotFrame:
    """Return the axes for a size in cells, with units of one-cell characters; without room the data take all.

    With `decades` the x are logarithms to the base 10, and the ticks show the values themselves.
    """
    columns, rows = max(columns, 1), max(rows, 1)
    y = _FrameAxis.along_y(proper_limits(y_limits), rows, y_unit)
    left, data_rows = max(map(len, y.labels)) + 1, rows - 2
    along = _FrameAxis.along_decades if decades else _FrameAxis.along_x
    x = along(proper_limits(x_limits), columns - left, x_unit)
    if columns - left < _LEAST_COLUMNS or data_rows < _LEAST_ROWS:
        text, left, data_rows = [" " * columns] * rows, 0, rows
    else:
        text = _axes(columns, rows, x, y)
        data_rows = next(row for row, line in enumerate(text) if _CORNER in line)
        left = text[data_rows].index(_CORNER) + 1
        text = _with_unit(text, data_rows, left - 1, y_unit)
    return PlotFrame(
        rows=tuple(text),
        left=left,
        data_columns=columns - left,
        data_rows=data_rows,
        x_limits=x.limits,
        y_limits=y.limits,
    )


class _Axes(Plot):
    """A figure of a given size: plotext would limit it to the terminal that it finds."""

    def __init__(self, columns: int, rows: int) -> None:
        super().__init__()
        self._limit_size(False, False)  # type: ignore[attr-defined]
        self.plot_size(columns, rows)


def _axes(columns: int, rows: int, x: _FrameAxis, y: _FrameAxis) -> list[str]:
    figure = _Axes(columns, rows)
    figure.theme("clear")
    figure.xlim(*x.limits)
    figure.ylim(*y.limits)
    figure.xaxes(True, False)
    figure.yaxes(True, False)
    figure.xticks(list(x.ticks), list(x.labels))
    figure.yticks(list(y.ticks), list(y.labels))
    # Without data plotext draws no ticks.
    figure.scatter([x.limits[0]], [y.limits[0]], marker=" ")
    return figure.uncolorize(figure.build()).split("\n")[:rows]


def _with_x_unit(label: str, unit: str) -> str:
    """Return the last label with the unit of the axis, as one writes it: 360°, 50/rev, 0.4 s."""
    return label + unit if unit[:1] in ("", "°", "/") else f"{label} {unit}"


def _with_unit(text: list[str], data_rows: int, width: int, unit: str) -> list[str]:
    """Put the unit into the first free row of the tick labels under the topmost of them."""
    taken = [bool(line[:width].strip()) for line in text[:data_rows]]
    free = next((row for row in range(1, data_rows) if taken[row - 1] and not taken[row]), None)
    if free is None:
        return text
    return [*text[:free], unit.rjust(width) + text[free][width:], *text[free + 1 :]]
