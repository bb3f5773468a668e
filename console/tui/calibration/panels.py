"""The panels of the page Calibrate: list, points and fit, and the plots beside them or in their place.

A plot of the fit has its 95 % limits and its points; another one the residuals.
"""

from __future__ import annotations

import numpy as np
from textual.containers import Horizontal, Vertical
from textual.geometry import Size

from console.tui.calibration.calibration_lines import fit_lines, list_lines, point_lines
from console.tui.calibration.chuck_facts import ChuckFacts, KeptCalibration
from console.tui.calibration.draft import Draft
from console.tui.entry import CalibrateEntry
from console.tui.lines import Line, Sheet, clip_lines, dim, entitle, line
from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import PointMarks, Series, TracePicture, TraceView
from console.tui.records.background_reader import Problems
from console.tui.rows import problem_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from console.units import METRIC, Units
from profiles.arrays import Floats, floats
from profiles.calibration.deflection import DeflectionFit
from profiles.calibration.table import CalibrationKind
from profiles.calibration.wrench import WrenchFit
from profiles.fields import Field
from profiles.problem import Problem

WIDE = 130  # columns from which plots and texts stand side by side
Kept = tuple[KeptCalibration, ...]
POINT, OUTLIER = "•", "✗"
_CURVE = 60
Pictures = tuple[TracePicture, TracePicture]


def pictures(facts: ChuckFacts, units: Units = METRIC) -> Pictures:
    """Return the fit, and the residuals; empty ones where there is nothing to draw."""
    if isinstance(facts.fit, WrenchFit):
        return _wrench(facts.fit, facts)
    if isinstance(facts.fit, DeflectionFit) and facts.measured is not None:
        return _deflection(facts.fit, facts, units)
    return TracePicture(), TracePicture()


def _wrench(fit: WrenchFit, facts: ChuckFacts) -> Pictures:
    """Force over torque: the line, its limits, those of one clamping, and the clampings."""
    torque = np.linspace(0.0 if not fit.intercept_ci else fit.lowest_n_m, fit.highest_n_m, _CURVE)
    bands = [fit.line_n(float(each)) for each in torque]
    inside = torque[torque >= fit.lowest_n_m]
    of_one = [fit.force_n(float(each)) for each in inside]
    series = [
        Series(x=inside, y=[band.low for band in of_one], token=Token.DIM, dashed=True),
        Series(x=inside, y=[band.high for band in of_one], token=Token.DIM, dashed=True),
        Series(x=torque, y=[band.value for band in bands], token=Token.AFTER),
    ]
    highest = max(band.high for band in of_one)
    x, y, left = floats([]), floats([]), floats([])
    if facts.measured is not None:
        x, y = facts.measured.columns["torque_n_m"], facts.measured.columns["force_n"]
        left = floats(y - fit.intercept_n - fit.slope_n_per_n_m * x)
        highest = max(highest, float(y.max()))
    x_limits = nice_limits(0.0, fit.highest_n_m)
    of_fit = TracePicture(
        series=series,
        x_limits=x_limits,
        y_limits=nice_limits(0.0, highest),
        y_unit="N",
        x_unit="N m",
        marks=_marks(x, y, fit.outliers),
    )
    return of_fit, _residuals(x, left, fit.outliers, "N", "N m", x_limits)


def _deflection(fit: DeflectionFit, facts: ChuckFacts, units: Units) -> Pictures:
    """Measured deflection over the fitted one; on the line they are the same."""
    assert facts.measured is not None  # ensured by the caller
    size, unit = units.size("um"), units.unit("um")
    modelled = floats(fit.deflections_um(facts.measured.columns) / size)
    y = floats(facts.measured.columns["deflection_um"] / size)
    limits = nice_limits(0.0, float(max(modelled.max(), y.max())))
    of_fit = TracePicture(
        series=[Series(x=limits, y=limits, token=Token.AFTER)],
        x_limits=limits,
        y_limits=limits,
        y_unit=unit,
        x_unit=unit,
        marks=_marks(modelled, y, fit.outliers),
    )
    return of_fit, _residuals(modelled, floats(y - modelled), fit.outliers, unit, unit, limits)


def _residuals(
    x: Floats, left: Floats, outliers: tuple[int, ...], y_unit: str, x_unit: str, x_limits: tuple[float, float]
) -> TracePicture:
    if not x.size:
        return TracePicture()
    most = max(float(np.abs(left).max()), 1e-9)
    return TracePicture(
        series=[Series(x=x_limits, y=(0.0, 0.0), token=Token.RING)],
        x_limits=x_limits,
        y_limits=nice_limits(-most, most),
        y_unit=y_unit,
        x_unit=x_unit,
        marks=_marks(x, left, outliers),
    )


def _marks(x: Floats, y: Floats, outliers: tuple[int, ...]) -> list[PointMarks]:
    out = np.isin(np.arange(x.size), outliers)
    marks = [PointMarks(x=x[~out], y=y[~out], sign=POINT, token=Token.BEFORE)]
    return [*marks, PointMarks(x=x[out], y=y[out], sign=OUTLIER, token=Token.WARNING)]


class CalibratePanels(Horizontal):
    """Everything on the page."""

    DEFAULT_CSS = """
    CalibratePanels {
        height: 1fr; width: 1fr;
        #calibrate-texts { width: 1fr; height: 1fr; }
        #calibrate-upper { height: 8; width: 1fr; }
        #calibrate-list { width: 1fr; height: 1fr; }
        #calibrate-points { width: 1fr; height: 1fr; }
        #calibrate-fit { height: 1fr; }
        #calibrate-row { height: 1; display: none; }
        #calibrate-label { width: auto; min-width: 34; height: 1; }
        #calibrate-entry { layer: default; position: relative; width: 1fr; }
        #calibrate-plots { width: 1fr; height: 1fr; layout: vertical; }
        #calibrate-plot { height: 2fr; }
        #calibrate-residual { height: 1fr; }
    }
    CalibratePanels.-beside #calibrate-upper { height: 18; }
    CalibratePanels.-beside #calibrate-texts { width: 80; }
    """

    def __init__(self, ui: UiContext) -> None:
        palette = ui.palette
        self._text = ui.text
        self.entry = CalibrateEntry()
        self.rows = Sheet(palette, id="calibrate-list", classes="panel")
        self.points = Sheet(palette, id="calibrate-points", classes="panel")
        self.fit_sheet = Sheet(palette, id="calibrate-fit", classes="panel")
        self.label = Sheet(palette, id="calibrate-label")
        self.row = Horizontal(self.label, self.entry, id="calibrate-row")
        self.plot = TraceView(palette=palette, id="calibrate-plot", classes="panel")
        self.residual = TraceView(palette=palette, id="calibrate-residual", classes="panel")
        upper = Horizontal(self.rows, self.points, id="calibrate-upper")
        self.texts = Vertical(upper, self.fit_sheet, self.row, id="calibrate-texts")
        self.plots = Vertical(self.plot, self.residual, id="calibrate-plots")
        super().__init__(self.texts, self.plots, id="calibrate-all")

    @property
    def sizes(self) -> tuple[Size, ...]:
        """The sizes by which lines are broken and plots drawn."""
        return tuple(sheet.size for sheet in (self.rows, self.points, self.fit_sheet))

    def lay_out(self, size: Size, *, plots: bool) -> None:
        """Show texts, plots, or both; the entry is beside the texts."""
        beside = size.width >= WIDE
        self.set_class(beside, "-beside")
        plots = plots and not self.entry.is_open
        self.plots.display = beside or plots
        self.texts.display = beside or not plots
        self.row.display = self.entry.is_open

    def ask(self, asked: Field | None, value: str, words: str) -> None:
        """Open the entry of a value, or of a path, with the words that say which."""
        self.texts.display = self.row.display = True  # or the entry could not have the focus
        self.label.show([line((f" {words} ", Token.ACTION))])
        self.entry.open(asked, value)

    def show_list(
        self, kept: Kept | Problems | None, draft: Draft | None, selected: int, title: str, note: str
    ) -> None:
        """Show the calibrations; `note` is why they are not read now."""
        text, size = self._text, self.rows.size
        width = max(size.width, 1)
        if note:
            lines: list[Line] = [line(dim(note))]
        elif kept is None:
            lines = [line(dim(text("calibrate_page.reading")))]
        else:
            lines = problem_lines([each for each in kept if isinstance(each, Problem)], text, width)
            found = [each for each in kept if isinstance(each, KeptCalibration)]
            lines = lines or list_lines(found, draft, selected, text, width, size.height)
        self.rows.show(lines, title)

    def show_facts(
        self, facts: ChuckFacts | Problems | None, kept: KeptCalibration | None, draft: Draft | None, kind: str
    ) -> None:
        """Show the selected calibration of a kind: its fit, its points, its plots with their units."""
        text = self._text
        size, points = self.fit_sheet.size, self.points.size
        titles = text("calibrate_page.fit"), text("calibrate_page.points")
        if not isinstance(facts, ChuckFacts):
            self.fit_sheet.show(problem_lines(facts or (), text, max(size.width, 1)), titles[0])
            self.points.show([], titles[1])
            facts = ChuckFacts()
        else:
            lines = fit_lines(facts, kept, text, max(size.width, 1))
            self.fit_sheet.show(clip_lines(lines, size.height, text("panel.more")), titles[0])
            rows = point_lines(facts, draft, text, max(points.width, 1), points.height)
            self.points.show(rows, titles[1])
        of_fit, of_residuals = pictures(facts, text.units)
        self.plot.show(of_fit)
        self.residual.show(of_residuals)
        known = kind in (CalibrationKind.WRENCH, CalibrationKind.DEFLECTION)
        axes = text(f"calibrate_page.axes.{kind}") if known else ""
        entitle(self.plot, text("calibrate_page.plot" if known else "calibrate_page.no_plot"), axes)
        entitle(self.residual, text("calibrate_page.residuals" if known else "calibrate_page.no_plot"), axes)
