"""The panels of the page Inspect: plot, tables and spectrum of a part, and how much of each is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike
from textual.containers import Horizontal, Vertical

from console.session.station.state import MeasuredPart
from console.text.catalogue import Catalogue
from console.text.part_sentences import at_height, extraction_words
from console.tui.inspection.comparison import PartComparison, Side, tolerance_rings_um
from console.tui.lines import BLANK, Line, Sheet, entitle, wrap_line
from console.tui.pages import inspect_lines
from console.tui.plot.canvas import DOTS_ACROSS
from console.tui.plot.cell_view import Cells, CellView
from console.tui.plot.frame import plot_frame, step_125, stepped_125
from console.tui.plot.polar_view import AngleMark, PolarTrace, PolarView, fitting_um_per_division
from console.tui.plot.stack_view import PartMapView, StackView
from console.tui.plot.trace_view import Series, TracePicture, trace_cells
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from profiles.arrays import Floats
from profiles.metrology.harmonics import spectrum_um_pp
from profiles.metrology.unrolled import UnrolledPart, unroll

MOST_ZOOM = 9  # steps of 1, 2, 5 in or out
_AXIS_CELLS = 8
_LEAST_HIGHEST, _WIDEST_UPR = 15, 500
_WIDEST_TABLE, _EVERY_ROW = 60, 1000

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


class PartView(StrEnum):
    """What is drawn of a part; `stack` and `map` are of all its sections."""

    ROUNDNESS = "roundness"
    SPECTRUM = "spectrum"
    STACK = "stack"
    MAP = "map"

    @property
    def is_along(self) -> bool:
        """Whether it shows the part along its length."""
        return self in (PartView.STACK, PartView.MAP)


class SpectrumView(CellView):
    """The spectra of one part or two."""

    _picture = SpectrumPicture()

    def show(self, picture: SpectrumPicture) -> None:
        """Draw these spectra instead of the last ones."""
        self._picture = picture
        self.redraw()

    def draw(self, columns: int, rows: int) -> Cells:
        """Return the picture of the last data for a size in cells."""
        return spectrum_cells(self._picture, columns, rows)


class InspectCharts(Horizontal):
    """Plot or spectrum on the left, tables on the right."""

    def __init__(self, ui: UiContext) -> None:
        palette, self._text = ui.palette, ui.text
        self.polar = PolarView(palette=palette, id="inspect-polar")
        self._caption = Sheet(palette, id="inspect-caption")
        self._result = Sheet(palette, id="inspect-result", classes="panel")
        self._harmonics = Sheet(palette, id="inspect-harmonics", classes="panel")
        self.spectrum = SpectrumView(palette=palette, id="inspect-spectrum", classes="panel")
        self._beside = SpectrumView(palette=palette, id="inspect-beside", classes="panel")
        self._stack = StackView(palette=palette, id="inspect-stack", classes="panel")
        self._map = PartMapView(palette=palette, id="inspect-map", classes="panel")
        self._unrolled: tuple[MeasuredPart | None, UnrolledPart | None] = (None, None)
        self._roundness = Vertical(self.polar, self._caption, id="inspect-roundness", classes="panel")
        left = Vertical(self._roundness, self.spectrum, self._stack, self._map, id="inspect-left")
        numbers = Vertical(self._result, self._harmonics, self._beside, id="inspect-numbers")
        super().__init__(left, numbers, id="inspect-charts")
        along = (self._stack, self._map)
        self.texts = (self._caption, self._result, self._harmonics, self.spectrum, self._beside, *along)

    def show(self, seen: PartComparison, zoom: int, *, view: PartView, simulated: bool) -> None:
        """Show a comparison, `zoom` steps closer than what holds all of it."""
        is_spectrum = view is PartView.SPECTRUM
        self._draw(seen, 0 if is_spectrum else zoom)
        if view.is_along:
            self._draw_along(seen.part, zoom, self._stack if view is PartView.STACK else self._map)
        for spectrum in (self.spectrum, self._beside):
            self._draw_spectrum(spectrum, seen, zoom if is_spectrum else 0)
        text, polar = self._text, self.polar
        figures = inspect_lines.name_evaluation(seen.result, text, seen.looked.circle)
        tolerance_um = None if seen.part.is_half else seen.part.job.roundness_tolerance_um
        zoomed = bool(zoom) and not is_spectrum
        scale = inspect_lines.scale_words(
            polar.scale_um_per_division, tolerance_um, text, ringed=polar.has_rings, zoomed=zoomed
        )
        entitle(self._roundness, text("inspect_page.roundness", figures=figures), scale)
        caption = inspect_lines.caption_lines(seen, text, self._caption.size.width, beyond=not polar.is_whole)
        self._caption.show(caption)
        rows = inspect_lines.result_lines(
            seen, simulated, text, *self._result.size, lobe_elsewhere=self._harmonics.display
        )
        self._result.show(rows, figures, text("inspect_page.looks"))
        by = inspect_lines.filter_words(seen.result, text)
        lines = inspect_lines.harmonic_lines(seen, text, *self._harmonics.size)
        self._harmonics.show(lines, text("inspect_page.harmonics", filter=by))

    def _draw(self, seen: PartComparison, zoom: int) -> None:
        sides = ((seen.before, Token.BEFORE, True), (seen.after, Token.AFTER, False))
        traces = [
            PolarTrace(angle_deg=side.angle_deg, deviation_um=side.profile_um, token=token, dashed=dashed)
            for side, token, dashed in sides
            if side is not None
        ]
        marks = [AngleMark(angle_deg=seen.part.jaw_1_deg, label="1")] if seen.part.phase_known else []
        unit_um = self._text.units.size("um")
        scale = stepped_125(fitting_um_per_division(traces, unit_um) / unit_um, -zoom) * unit_um
        rings = None
        if not seen.part.is_half:
            rings = tolerance_rings_um(seen.last, seen.part.job.roundness_tolerance_um)
        self.polar.show(traces, um_per_division=scale, marks=marks, rings_um=rings, unit_um=unit_um)

    def _draw_along(self, part: MeasuredPart, zoom: int, view: StackView | PartMapView) -> None:
        """Draw all sections of a part, if it has them."""
        if part.whole is not None and self._unrolled[0] is not part:
            self._unrolled = part, unroll(part.sections, part.whole.filter_upr)
        marks = [AngleMark(angle_deg=part.jaw_1_deg, label="1")] if part.phase_known else []
        if part.whole is not None and self._unrolled[1] is not None:
            view.show_part(self._unrolled[1], marks, self._text, zoom)

    def _draw_spectrum(self, view: SpectrumView, seen: PartComparison, zoom: int) -> None:
        if not view.display or not view.size.width:
            return
        highest = highest_order(seen, view.size.width)
        bars = [Bars(um_pp=orders_um_pp(seen.last), token=Token.AFTER)]
        if seen.other is not None:
            bars.insert(0, Bars(um_pp=orders_um_pp(seen.before), token=Token.BEFORE, thin=True))
        unit_um, jaws = self._text.units.size("um"), seen.part.job.jaws
        top_um = stepped_125(fitting_top_um(bars, highest, unit_um) / unit_um, -zoom) * unit_um
        marked = [jaws * multiple for multiple in range(1, inspect_lines.FRONT_MULTIPLES + 1)]
        unit = self._text.units.unit("um")
        view.show(
            SpectrumPicture(bars=bars, highest=highest, top_um=top_um, marked=marked, unit=unit, unit_um=unit_um)
        )
        words = self._spectrum_words(seen, zoomed=bool(zoom), top_um=top_um)
        entitle(view, self._text("inspect_page.spectrum", filter=words[0]), words[1])

    def _spectrum_words(self, seen: PartComparison, *, zoomed: bool, top_um: float) -> tuple[str, str]:
        text = self._text
        key = "spectrum_zoomed" if zoomed else "spectrum_top"
        return inspect_lines.filter_words(seen.result, text), text(
            f"inspect_page.{key}", um=text.units.format_short(top_um, "um")
        )


def orders_um_pp(side: Side) -> Floats:
    """Return the spectrum of a part by order; of one at unequal angles the fitted harmonics."""
    spectrum = spectrum_um_pp(side.angle_deg, side.profile_um)
    if spectrum.size or side.result is None:
        return spectrum
    spectrum.resize(_LEAST_HIGHEST + 1)
    for harmonic in side.result.harmonics:
        spectrum[harmonic.n] = 2.0 * harmonic.amplitude_um
    return spectrum


def highest_order(seen: PartComparison, width: int) -> int:
    """Return the highest order that is drawn: up to the cut-off, as far as a column of cells shows one each."""
    upr = min(int(seen.result.filter_upr or _WIDEST_UPR), seen.last.angle_deg.size // 2)
    return max(min(upr, width - _AXIS_CELLS), _LEAST_HIGHEST)


def full_lines(seen: PartComparison, text: Catalogue, width: int, *, simulated: bool) -> list[Line]:
    """Return every figure of both parts, without a height."""
    room = min(width, _WIDEST_TABLE)
    rows = inspect_lines.result_lines(seen, simulated, text, room, _EVERY_ROW, lobe_elsewhere=True)
    rows += wrap_line(at_height(seen.part.section_z_mm, text), width)
    if seen.part.whole is not None:
        said = extraction_words(seen.part.whole, seen.part.trace.meta, text)
        rows += [row for each in said for row in wrap_line(each, width, Token.DIM)]
    return [*rows, BLANK, *inspect_lines.harmonic_lines(seen, text, room, _EVERY_ROW)]
