"""The panels of the page Calibrate: list, points and fit, and the plots beside them or in their place."""

from __future__ import annotations

from textual.containers import Horizontal, Vertical
from textual.geometry import Size

from console.tui.calibrating.calibration_lines import fit_lines, list_lines, point_lines
from console.tui.calibrating.chuck_facts import ChuckFacts
from console.tui.calibrating.draft import Draft
from console.tui.calibrating.entry import CalibrateEntry
from console.tui.calibrating.kept_list import KeptCalibration
from console.tui.calibrating.pictures import pictures
from console.tui.further.problem_lines import problem_lines
from console.tui.lines import Line, Sheet, clipped, dim, entitle, line
from console.tui.plot.trace_view import TraceView
from console.tui.records.background_reader import Problems
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from profiles.calibration.table import CalibrationKind
from profiles.fields import Field
from profiles.problem import Problem

WIDE = 130  # columns from which plots and texts stand side by side
Kept = tuple[KeptCalibration, ...]


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
        #calibrate-entry { width: 1fr; height: 1; background: $background; color: $foreground; }
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
            self.fit_sheet.show(clipped(lines, size.height, text("panel.more")), titles[0])
            rows = point_lines(facts, draft, text, max(points.width, 1), points.height)
            self.points.show(rows, titles[1])
        of_fit, of_residuals = pictures(facts, text.units)
        self.plot.show(of_fit)
        self.residual.show(of_residuals)
        known = kind in (CalibrationKind.WRENCH, CalibrationKind.DEFLECTION)
        axes = text(f"calibrate_page.axes.{kind}") if known else ""
        entitle(self.plot, text("calibrate_page.plot" if known else "calibrate_page.no_plot"), axes)
        entitle(self.residual, text("calibrate_page.residuals" if known else "calibrate_page.no_plot"), axes)
