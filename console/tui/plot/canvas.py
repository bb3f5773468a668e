"""Raster of dots, two across and four down in each terminal cell, converted to text.

The dots of all layers are merged, so crossing traces show no gaps; the colour of a cell is that of the
highest layer with a dot in it. A dot has integer coordinates: x to the right from 0, y down from 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

DOTS_ACROSS = 2
DOTS_DOWN = 4
NO_LAYER = -1

_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
"""Bit of each dot of a cell in the order of the braille block."""
_BRAILLE, _BLANK = np.uint32(0x2800), np.uint32(ord(" "))
_FAR_DOTS = 1.0e9  # coordinates further out than this are clamped to it: the line leaves the canvas either way


@dataclass(frozen=True, slots=True, kw_only=True)
class Dash:
    """A line of `on` dots and then `off` blanks, along its length."""

    on: int
    off: int


class BrailleCanvas:
    """Dots on a rectangle of at least one cell; width and height are in cells."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns = max(columns, 1)
        self.rows = max(rows, 1)
        self.width_dots = self.columns * DOTS_ACROSS
        self.height_dots = self.rows * DOTS_DOWN
        self._dots = np.zeros((self.height_dots, self.width_dots), dtype=np.uint8)
        self._layers = np.full((self.rows, self.columns), NO_LAYER, dtype=np.int16)

    def points(self, x: ArrayLike, y: ArrayLike, layer: int) -> None:
        """Set the dot nearest to each point; points outside, and those that are not numbers, are left out."""
        x_dots, y_dots = _limit_values(x), _limit_values(y)
        known = ~(np.isnan(x_dots) | np.isnan(y_dots))
        self._set(_nearest(x_dots[known]), _nearest(y_dots[known]), layer)

    def polyline(self, x: ArrayLike, y: ArrayLike, layer: int, dash: Dash | None = None) -> None:
        """Join points by lines one dot wide, with both ends unless dashed; what is no number breaks the line."""
        path = _Path.from_points(x, y)
        tread = path.tread(self.width_dots, self.height_dots)
        if dash is not None:
            shown = np.arange(tread.x.size) % (dash.on + dash.off) < dash.on
            self._set(tread.x[shown], tread.y[shown], layer)
            return
        self._set(tread.x, tread.y, layer)
        self._set(*path.knots(tread), layer)

    def cell_codes(self) -> NDArray[np.uint32]:
        """Return the character code of each cell (rows x columns); a cell without dots is a blank."""
        cells = self._dots.reshape(self.rows, DOTS_DOWN, self.columns, DOTS_ACROSS)
        bits = np.einsum("rdca,da->rc", cells, _BITS)
        return np.where(bits > 0, _BRAILLE + bits, _BLANK)

    def cell_layers(self) -> NDArray[np.int16]:
        """Return the highest layer with a dot in each cell (rows x columns), `NO_LAYER` where there is none."""
        return self._layers.copy()

    def _set(self, x: Ints, y: Ints, layer: int) -> None:
        inside = (x >= 0) & (x < self.width_dots) & (y >= 0) & (y < self.height_dots)
        x, y = x[inside], y[inside]
        self._dots[y, x] = 1
        cells = (y // DOTS_DOWN, x // DOTS_ACROSS)
        self._layers[cells] = np.maximum(self._layers[cells], layer)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tread:
    x: Ints
    y: Ints
    step: Ints  # the step of the path that each dot belongs to
    done: Ints  # how many dots there are up to the end of each step

    def gap_after(self, steps: Ints, piece: Ints) -> Flags:
        """Return for each of these steps whether the dots before and after its end do not touch."""
        if self.x.size == 0:
            return np.ones(steps.size, dtype=np.bool_)
        before = np.maximum(self.done[steps] - 1, 0)
        after = np.minimum(self.done[steps], self.x.size - 1)
        apart = np.maximum(np.abs(self.x[after] - self.x[before]), np.abs(self.y[after] - self.y[before]))
        elsewhere = (piece[self.step[before]] != piece[steps]) | (piece[self.step[after]] != piece[steps])
        at_the_rim = (self.done[steps] == 0) | (self.done[steps] == self.x.size)
        gap: Flags = (apart > 1) | elsewhere | at_the_rim
        return gap


@dataclass(frozen=True, slots=True, kw_only=True)
class _Path:
    """A polyline cut into straight steps, each with the axis along which it is the longer ("major")."""

    x: Floats
    y: Floats
    joined: Flags  # whether the step from this point to the next is drawn
    steep: Flags  # whether y is the major axis of the step
    ahead: Floats  # how far the step goes along its major axis, with its sign, dots
    aside: Floats  # how far it goes along the other axis

    @classmethod
    def from_points(cls, x: ArrayLike, y: ArrayLike) -> Self:
        x_dots, y_dots = _limit_values(x), _limit_values(y)
        new = np.ones(x_dots.size, dtype=np.bool_)
        new[1:] = (x_dots[1:] != x_dots[:-1]) | (y_dots[1:] != y_dots[:-1])
        x_dots, y_dots = x_dots[new], y_dots[new]
        right, down = np.diff(x_dots), np.diff(y_dots)
        steep = np.abs(down) > np.abs(right)
        return cls(
            x=x_dots,
            y=y_dots,
            joined=~np.isnan(right + down),
            steep=steep,
            ahead=np.where(steep, down, right),
            aside=np.where(steep, right, down),
        )

    def tread(self, width_dots: int, height_dots: int) -> _Tread:
        """Return the dots, in order, that are nearest to the path in each column (each row, where it is steep)."""
        across, down = self.x[:-1], self.y[:-1]
        start = np.where(self.steep, down, across)
        size = np.where(self.steep, height_dots, width_dots)
        first = np.maximum(np.ceil(np.minimum(start, start + self.ahead)), 0.0)
        last = np.minimum(np.floor(np.maximum(start, start + self.ahead)), size - 1.0)
        count = np.where(self.joined, np.maximum(last - first + 1.0, 0.0), 0.0).astype(np.int64)
        step = np.repeat(np.arange(count.size), count)
        nth = np.arange(step.size) - np.repeat(np.cumsum(count) - count, count)
        ahead, steep = self.ahead[step], self.steep[step]
        major = np.where(ahead > 0.0, first[step] + nth, last[step] - nth)
        minor = np.where(steep, across[step], down[step]) + (major - start[step]) * (self.aside[step] / ahead)
        return _Tread(
            x=_nearest(np.where(steep, minor, major)),
            y=_nearest(np.where(steep, major, minor)),
            step=step,
            done=np.cumsum(count),
        )

    def knots(self, tread: _Tread) -> tuple[Ints, Ints]:
        """Return the dots of ends, turning points and corners that close a gap; others are warts on circles."""
        before = np.zeros(self.x.size, dtype=np.bool_)
        after = before.copy()
        before[1:], after[:-1] = self.joined, self.joined
        chosen = ~np.isnan(self.x + self.y) & ~(before & after)
        bent = self.steep[1:] != self.steep[:-1]
        turned = ~bent & (self.ahead[1:] * self.ahead[:-1] < 0.0)
        corners = np.flatnonzero(bent & self.joined[1:] & self.joined[:-1])
        chosen[1:-1] |= turned & self.joined[1:] & self.joined[:-1]
        chosen[corners[tread.gap_after(corners, np.cumsum(~self.joined))] + 1] = True
        return _nearest(self.x[chosen]), _nearest(self.y[chosen])


def _limit_values(values: ArrayLike) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    tame: Floats = np.clip(np.where(np.isinf(array), np.nan, array), -_FAR_DOTS, _FAR_DOTS)
    return tame


def _nearest(values: Floats) -> Ints:
    return np.floor(values + 0.5).astype(np.int64)
