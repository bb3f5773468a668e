"""Map of a surface: the deviation over angle x Z, one sign a cell.

What stands high is shaded, what is low has dots and strokes, so that the sign is read without colour; each step
of the scale has its own. The free end is at the top. A cell shows the value that is furthest from 0 among those of
the section nearest to its row: a narrow fault does not vanish between two columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from console.tui.plot.canvas import Floats
from console.tui.plot.cell_view import UNKNOWN, Cells, CellView
from console.tui.plot.frame import label, step_125
from console.tui.plot.polar_view import AngleMark
from console.tui.theme import Token
from console.units import METRIC, Units

HIGH, LOW = "░▒▓", ".:="  # signs of one, two and three steps
WORST = "▸"
STEPS = len(HIGH)
_LEAST_UM_PER_STEP = 0.1
_TICKS_DEG = (0.0, 120.0, 240.0, 360.0)
_LEAST_COLUMNS, _LEAST_ROWS = 12, 3  # with fewer cells of data, the axes are left out
_FEET = 2  # rows under the map: its angles, its legend


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceMap:
    """What a map shows.

    `z_mm` has the shape (Z,), `angle_deg` (angle,) in any order, `deviation_um` (Z, angle), positive where the
    part is high; what is not a number is shown as "?". `worst` is the index of the section that is marked.
    Without `um_per_step` the scale is the smallest round one that holds all values.
    """

    z_mm: ArrayLike
    angle_deg: ArrayLike
    deviation_um: ArrayLike
    um_per_step: float | None = None
    worst: int | None = None
    marks: Sequence[AngleMark] = ()
    units: Units = METRIC

    @property
    def scale_um(self) -> float:
        """Um in one step of the scale, round in the shown unit; the largest sign begins at 2.5 steps."""
        if self.um_per_step is not None:
            return self.um_per_step
        values = np.abs(np.asarray(self.deviation_um, dtype=np.float64))
        largest, unit_um = float(values[np.isfinite(values)].max(initial=0.0)), self.units.size("um")
        return step_125(max(largest / (STEPS + 0.5), _LEAST_UM_PER_STEP) / unit_um) * unit_um


def map_cells(picture: SurfaceMap, columns: int, rows: int) -> Cells:
    """Return a map with its axes and legend for a size in cells; without room for those, the map alone."""
    cells, z_mm = Cells.blank(columns, rows), np.asarray(picture.z_mm, dtype=np.float64)
    if not z_mm.size:
        return cells
    labels = [picture.units.figure(float(each), "mm", 1) for each in z_mm]
    left, height = max(map(len, labels)) + 1, rows - _FEET
    if columns - left < _LEAST_COLUMNS or height < _LEAST_ROWS:
        left, height = 0, rows
    shown = _section_of_rows(z_mm, height, picture.worst)
    signs, tokens = _signs(picture, shown, columns - left)
    cells.codes[:height, left:], cells.tokens[:height, left:] = signs, tokens
    if left:
        _write_z(cells, labels, shown, picture.worst)
        cells.write(height, 0, picture.units.unit("mm").rjust(left - 1), Token.AXIS)
        write_angles(cells, picture.marks, height, left, columns - left)
        cells.write(height + 1, 0, legend(picture), Token.AXIS)
    return cells


def legend(picture: SurfaceMap) -> str:
    """Return the two signs of each division, high and low, with the size of one in the shown unit."""
    units, step = picture.units, picture.scale_um / picture.units.size("um")
    pairs = enumerate(zip(HIGH, LOW, strict=True), start=1)
    signs = "  ".join(f"{nth} {high}/{low}" for nth, (high, low) in pairs)
    return f"+/-  {signs}  {label(step)} {units.unit('um')}/div"


def _section_of_rows(z_mm: Floats, rows: int, worst: int | None) -> NDArray[np.int64]:
    """Return the nearest section of each row, from the free end down; that marked is never left out."""
    height_mm = np.linspace(z_mm.max(), z_mm.min(), rows)
    shown: NDArray[np.int64] = np.abs(height_mm[:, None] - z_mm).argmin(axis=1)
    if worst is not None and worst not in shown:
        shown[np.abs(height_mm - z_mm[worst]).argmin()] = worst
    return shown


def _signs(
    picture: SurfaceMap, shown: NDArray[np.int64], columns: int
) -> tuple[NDArray[np.uint32], NDArray[np.uint8]]:
    """Return the code and the token of each cell."""
    angle_deg = np.mod(np.asarray(picture.angle_deg, dtype=np.float64), 360.0)
    values = np.asarray(picture.deviation_um, dtype=np.float64)
    order = np.argsort(angle_deg, kind="stable")
    edges_deg = 360.0 * np.arange(columns + 1) / columns
    edges = np.searchsorted(angle_deg[order], edges_deg)
    steps = np.zeros((shown.size, columns), dtype=np.int64)
    known = np.ones(steps.shape, dtype=np.bool_)
    for column, (first, last) in enumerate(pairwise(edges)):
        middle_deg = (edges_deg[column] + edges_deg[column + 1]) / 2.0
        apart_deg = np.abs((angle_deg - middle_deg + 180.0) % 360.0 - 180.0)
        inside = order[first:last] if last > first else np.array([apart_deg.argmin()])
        of_cell = values[shown][:, inside]
        furthest = np.take_along_axis(of_cell, np.abs(of_cell).argmax(axis=1)[:, None], axis=1)[:, 0]
        known[:, column] = np.isfinite(furthest)
        rounded = np.floor(np.abs(furthest) / picture.scale_um + 0.5)
        steps[:, column] = np.where(known[:, column], np.sign(furthest) * np.minimum(rounded, STEPS), 0.0)
    ramp = np.array([ord(each) for each in chain(reversed(LOW), " ", HIGH)], dtype=np.uint32)
    codes = np.where(known, ramp[steps + STEPS], np.uint32(ord(UNKNOWN)))
    tokens = np.where(steps > 0, Token.HIGH.value, np.where(steps < 0, Token.LOW.value, Token.TEXT.value))
    return codes, tokens.astype(np.uint8)


def _write_z(cells: Cells, labels: Sequence[str], shown: NDArray[np.int64], worst: int | None) -> None:
    """Write Z at the ends, and at the marked section instead of what would touch it."""
    marked = None if worst is None else int(np.flatnonzero(shown == worst)[0])
    width = max(map(len, labels))
    for row in (0, shown.size - 1):
        cells.write(row, 0, labels[shown[row]].rjust(width), Token.AXIS)
    if marked is not None and worst is not None:
        cells.write(marked, 0, labels[worst].rjust(width) + WORST, Token.MARK)


def write_angles(cells: Cells, marks: Sequence[AngleMark], row: int, left: int, columns: int) -> None:
    """Write the marks and the angles of a turn under so many columns; an angle that would touch is left out."""
    words = [(f"▴{each.label}", int(each.angle_deg % 360.0 / 360.0 * columns), Token.MARK) for each in marks]
    for tick_deg in _TICKS_DEG:
        text = label(tick_deg) + ("°" if tick_deg == _TICKS_DEG[-1] else "")
        words.append((text, round(tick_deg / 360.0 * columns - len(text) / 2.0), Token.AXIS))
    taken: set[int] = set()
    for text, start, token in words:
        first = min(max(start, 0), columns - len(text))
        if taken.isdisjoint(range(first - 1, first + len(text) + 1)):
            cells.write(row, left + first, text, token)
            taken.update(range(first, first + len(text)))


class SurfaceMapView(CellView):
    """A map of the last surface; an update costs only what has changed."""

    _picture = SurfaceMap(z_mm=(), angle_deg=(), deviation_um=())

    def show(self, picture: SurfaceMap) -> None:
        """Draw this surface instead of the last one."""
        self._picture = deepcopy(picture)  # the caller may reuse its arrays
        self.redraw()

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture of the last surface for a size in cells."""
        return map_cells(self._picture, columns, rows)
