"""Roundness plot: the magnified deviation from a circle, against the angle of the part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from console.tui.plot.canvas import DOTS_ACROSS, DOTS_DOWN, BrailleCanvas, Dash, Floats
from console.tui.plot.cell_view import Cells, CellView
from console.tui.plot.frame import FRAMES_KEPT, step_125
from console.tui.theme import Token

Rings = tuple[float, float]
"""Radii of the two tolerance rings, um from the reference ring."""

DIVISIONS = 2  # divisions between the reference ring and the largest deviation shown, on either side
_REFERENCE_FRACTION = 0.6
"""Radius of the reference ring as a fraction of the largest radius: equal room within and without."""
_LEAST_DOTS_PER_DIVISION = 4.0  # distance below which rings blur
_LEAST_UM_PER_DIVISION = 0.1  # smallest division: a part is not shown rounder than it can be measured
_TICK_DOTS = 3.0
_BEFORE_DASH = Dash(on=2, off=3)
OFF_THE_DOTS_DEG = 0.37
"""Offset of a ring's points: at round angles they fall between dots, where the last bit of a cosine decides."""

_RING_DASH = Dash(on=1, off=1)
_DIVISION_DASH = Dash(on=1, off=5)
_TOLERANCE_DASH = Dash(on=1, off=2)
_LEAST_DOTS_BETWEEN = 3.0  # distance below which two tolerance rings and the trace between them blur
_RING_LAYER, _TOLERANCE_LAYER, _MARK_LAYER, _FIRST_TRACE_LAYER = 0, 1, 2, 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolarTrace:
    """A closed trace; angles counter-clockwise from 3 o'clock. What is not a number leaves a gap."""

    angle_deg: ArrayLike
    deviation_um: ArrayLike  # outwards positive, from the reference circle, on the radius
    token: Token
    dashed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleMark:
    """A labelled angle on the part, such as jaw 1; the label is of characters one cell wide."""

    angle_deg: float
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Dial:
    """Position of the circle on a canvas, in dots: as many to the right as up, since dots are square."""

    x: float
    y: float
    reference: float  # radius of the reference ring
    division: float  # distance between rings

    def spot(self, angle_deg: ArrayLike, radius: ArrayLike) -> tuple[Floats, Floats]:
        """Return the coordinates of points on the canvas from their angles, deg, and radii, dots."""
        angle = np.radians(np.asarray(angle_deg, dtype=np.float64))
        distance = np.asarray(radius, dtype=np.float64)
        return self.x + distance * np.cos(angle), self.y - distance * np.sin(angle)

    @property
    def rim(self) -> float:
        """The largest radius that a trace takes up when the scale fits."""
        return self.reference + DIVISIONS * self.division


def dial(columns: int, rows: int) -> Dial:
    """Return the largest dial in the middle of a size in cells."""
    width, height = columns * DOTS_ACROSS, rows * DOTS_DOWN
    rim = (min(width, height) - 1) / 2.0
    # The middle lies between dots: with half a dot over, the four outermost dots of the ring are exact.
    reference = math.floor(_REFERENCE_FRACTION * rim) + 0.5
    return Dial(
        x=(width - 1) / 2.0,
        y=(height - 1) / 2.0,
        reference=reference,
        division=max(rim - reference, 0.0) / DIVISIONS,
    )


def fitting_um_per_division(traces: Sequence[PolarTrace], unit_um: float = 1.0) -> float:
    """Return the smallest scale on which the largest deviation of all traces fits, round in units of `unit_um`."""
    values = [np.abs(np.asarray(trace.deviation_um, dtype=np.float64)) for trace in traces]
    largest = max((float(value[np.isfinite(value)].max(initial=0.0)) for value in values), default=0.0)
    return step_125(max(largest / DIVISIONS, _LEAST_UM_PER_DIVISION) / unit_um) * unit_um


def fits(traces: Sequence[PolarTrace], um_per_division: float, unit_um: float = 1.0) -> bool:
    """Whether all of the traces are within the plot on a scale, which is round in units of `unit_um`."""
    return fitting_um_per_division(traces, unit_um) <= um_per_division * (1.0 + 1.0e-9)


def shows_rings(rings_um: Rings, um_per_division: float, columns: int, rows: int) -> bool:
    """Whether two tolerance rings are far enough apart, and near enough, to be seen on a scale."""
    place = dial(columns, rows)
    inner, outer = (place.reference + each / um_per_division * place.division for each in rings_um)
    return outer - inner >= _LEAST_DOTS_BETWEEN and inner > 0.0 and outer <= place.rim


def polar_cells(
    traces: Sequence[PolarTrace],
    marks: Sequence[AngleMark],
    um_per_division: float,
    columns: int,
    rows: int,
    rings_um: Rings | None = None,
) -> Cells:
    """Return rings, traces and marks for a size in cells; later traces lie over earlier ones.

    What a scale leaves no room for, outside the rim or within the centre, is a gap in its trace.
    """
    cells = Cells.blank(columns, rows)
    canvas = deepcopy(_rings(columns, rows))  # the part that does not change with the data
    place = dial(columns, rows)
    if rings_um is not None and shows_rings(rings_um, um_per_division, columns, rows):
        circle_deg = np.arange(361.0) + OFF_THE_DOTS_DEG
        for each in rings_um:
            radius = np.full(361, place.reference + each / um_per_division * place.division)
            canvas.polyline(*place.spot(circle_deg, radius), _TOLERANCE_LAYER, _TOLERANCE_DASH)
    for mark in marks:
        tick = np.array([max(place.rim - _TICK_DOTS, 0.0), place.rim])
        canvas.polyline(*place.spot(mark.angle_deg, tick), _MARK_LAYER)
    for layer, trace in enumerate(traces, start=_FIRST_TRACE_LAYER):
        deviation = np.asarray(trace.deviation_um, dtype=np.float64) / um_per_division * place.division
        radius = place.reference + deviation
        seen = (radius >= 0.0) & (radius <= place.rim + 0.5)
        x, y = place.spot(trace.angle_deg, np.where(seen, radius, np.nan))
        dash = _BEFORE_DASH if trace.dashed else None
        canvas.polyline(np.append(x, x[:1]), np.append(y, y[:1]), layer, dash)
    cells.lay(canvas, 0, 0, (Token.RING, Token.TOLERANCE, Token.MARK, *(trace.token for trace in traces)))
    for mark in marks:
        _label(cells, place, mark)
    return cells


@lru_cache(maxsize=FRAMES_KEPT)
def _rings(columns: int, rows: int) -> BrailleCanvas:
    canvas, place = BrailleCanvas(columns, rows), dial(columns, rows)
    circle_deg = np.arange(361.0) + OFF_THE_DOTS_DEG
    canvas.polyline(*place.spot(circle_deg, np.full(361, place.reference)), _RING_LAYER, _RING_DASH)
    if place.division >= _LEAST_DOTS_PER_DIVISION:
        for radius in (place.reference - place.division, place.reference + place.division):
            canvas.polyline(*place.spot(circle_deg, np.full(361, radius)), _RING_LAYER, _DIVISION_DASH)
    for angle_deg in (0.0, 90.0):
        arm = min(_LEAST_DOTS_PER_DIVISION / 2.0, place.reference / 3.0)
        canvas.polyline(*place.spot(angle_deg, np.array([-arm, arm])), _RING_LAYER)
    return canvas


def _label(cells: Cells, place: Dial, mark: AngleMark) -> None:
    """Write a label outside the rim, or as far out as there is room."""
    x, y = (float(value) for value in place.spot(mark.angle_deg, place.rim + DOTS_DOWN / 2.0))
    length = len(mark.label)
    cosine = math.cos(math.radians(mark.angle_deg))
    # To the right of the rim a label begins there, to the left it ends there, above and below it is centred.
    start = x / DOTS_ACROSS - (1.0 - cosine) / 2.0 * (length - 1)
    column = min(max(round(start), 0), max(cells.columns - length, 0))
    row = min(max(int(y // DOTS_DOWN), 0), cells.rows - 1)
    cells.write(row, column, mark.label, Token.MARK)


class PolarView(CellView):
    """Roundness traces around one reference ring, on one scale, and round on the screen."""

    _traces: tuple[PolarTrace, ...] = ()
    _marks: tuple[AngleMark, ...] = ()
    _rings_um: Rings | None = None
    _unit_um = 1.0
    scale_um_per_division = 1.0

    def show(
        self,
        traces: Sequence[PolarTrace],
        *,
        um_per_division: float | None = None,
        marks: Sequence[AngleMark] = (),
        rings_um: Rings | None = None,
        unit_um: float = 1.0,
    ) -> None:
        """Draw these traces, the last one on top; without a scale, on the smallest round one on which all fit.

        A round scale is one in units of `unit_um`.
        """
        self._traces, self._marks = deepcopy(tuple(traces)), tuple(marks)  # the caller may reuse its arrays
        self._rings_um = rings_um
        self._unit_um = unit_um
        self.scale_um_per_division = um_per_division or fitting_um_per_division(self._traces, unit_um)
        self.redraw()

    @property
    def is_whole(self) -> bool:
        """Whether nothing of the traces is outside the plot."""
        return fits(self._traces, self.scale_um_per_division, self._unit_um)

    @property
    def has_rings(self) -> bool:
        """Whether the tolerance rings are seen."""
        scale = self.scale_um_per_division
        return self._rings_um is not None and shows_rings(self._rings_um, scale, *self._room)

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture of the last data for a size in cells."""
        return polar_cells(self._traces, self._marks, self.scale_um_per_division, columns, rows, self._rings_um)
