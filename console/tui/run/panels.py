"""Panels of the page Run: what they show before a cut, in it, at its end, after a stop and without a link."""

from __future__ import annotations

from textual.containers import Horizontal, Vertical
from textual.widget import Widget

from console.session.cut.alignment import JawAngle
from console.session.cut.telemetry import stretches_event
from console.session.guide.situation import GuidePhase
from console.session.guide.start_checks import checks
from console.session.station.progress import CutProgress
from console.text.along_length import stretch_words
from console.tui.lines import BLANK, NOTHING, Line, Sheet, clip_lines, dim, entitle, line, wrap_line
from console.tui.pages import run_lines
from console.tui.pages.cut_lines import large_lines, live_lines, mean_error_um, progress_line, values_title
from console.tui.pages.stop_lines import cut_of_stop, lost_lines, spindle_line, stale, stop_lines
from console.tui.plot.polar_view import AngleMark, PolarTrace, PolarView
from console.tui.plot.trace_view import TracePicture, TraceView
from console.tui.run.adjust_lines import adjust_line
from console.tui.run.error_band import band_series, error_band
from console.tui.run.moment_lines import moment_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from drivers.cutting.bounds import Adjustable

FULL_TURN_DEG = (0.0, 360.0)
WIDEST_FACT = 56  # columns in which a label and its value are still read together
LEAST_WIDTH = 10  # a narrower panel has not got its size yet: a text in it would be broken by letters


class _PanelRow(Horizontal):
    BLANK = True  # panels cover it: there are no rows of its own to paint at every tick


class _PanelColumn(Vertical):
    BLANK = True


class RunPanels:
    """Two panels beside each other, and in a cut its progress over its values and plots.

    `widgets` are what the page is composed of.
    """

    def __init__(self, ui: UiContext) -> None:
        self._ui, palette = ui, ui.palette
        self._left = Sheet(palette, id="run-left")
        self._right = Sheet(palette, id="run-right")
        self._progress = Sheet(palette, id="run-progress")
        self._values = Sheet(palette, id="run-values")
        self._errors = TraceView(palette=palette, id="run-errors")
        self._polar = PolarView(palette=palette, id="run-polar")
        self._moment = Sheet(palette, id="run-program")
        self._drawn: CutProgress | None = None
        self._errors.border_title = ui.text("run_page.errors")
        plots = _PanelColumn(self._errors, self._polar, self._moment, id="run-plots")
        self.widgets: tuple[Widget, ...] = (
            _PanelRow(self._left, self._right, id="run-two"),
            _PanelColumn(self._progress, _PanelRow(self._values, plots, id="run-moment"), id="run-live"),
        )

    def redraw(self) -> None:
        """Draw the plots again, even of a cut that has not moved on since."""
        self._drawn = None

    def have_room(self, phase: GuidePhase) -> bool:
        """Whether the panels of a phase know their size; if not, they are emptied."""
        panels = (self._progress, self._values) if phase is GuidePhase.CUTTING else (self._left, self._right)
        if all(panel.size.width >= LEAST_WIDTH for panel in panels):
            return True
        for panel in panels:
            panel.show([])
        return False

    def fill(self, phase: GuidePhase, view: View, adjusts: Adjustable, *, roomy: bool) -> None:
        """Show the newest state in the panels of its phase; `adjusts` is what + and - change.

        Without `roomy` there is no polar plot.
        """
        cut = view.state.cut
        match phase:
            case GuidePhase.CUTTING if cut is not None:
                self._show_cut(cut, view, adjusts, roomy=roomy)
            case GuidePhase.ENDED if cut is not None:
                self._show_end(cut, view)
            case GuidePhase.STOPPED:
                self._show_stop(view)
            case GuidePhase.LOST:
                self._show_lost(view)
            case _:
                self._show_before(view)

    def _show_before(self, view: View) -> None:
        text, state, work = self._ui.text, view.state, view.work
        machine, size = self._ui.machine.machine, self._left.size
        moves: list[Line] = []
        if state.armed is not None:
            moves = [*run_lines.moves_lines(text, state.armed, machine, size.width), BLANK]
        inputs = run_lines.input_lines(text, state.snapshot, size.width, size.height - len(moves))
        room = size.height - len(moves) - len(inputs)
        found = run_lines.check_lines(text, checks(state, work, machine), size.width, room)
        self._left.show([*moves, *found, *inputs], text("run_page.checks"))
        width, rows = self._right.size.width, wrap_line(text("run_page.no_job"), self._right.size.width)
        if work is not None:
            rows = run_lines.summary_lines(text, state, work, view.now_s, min(width, WIDEST_FACT))
            rows = clip_lines(rows, self._right.size.height, text("panel.more"))
        self._right.show(rows, text("run_page.summary" if state.armed is None else "run_page.armed_title"))

    def _show_cut(self, cut: CutProgress, view: View, adjusts: Adjustable, *, roomy: bool) -> None:
        text, size = self._ui.text, self._values.size
        where = text("run_page.cut_in_air" if cut.in_air else "run_page.cut")
        along = stretch_words(stretches_event(cut.stretches), text, "brief") if cut.judged else ""
        self._progress.show([progress_line(text, cut, self._progress.size.width)], where, along)
        width = min(size.width, WIDEST_FACT)
        rows = live_lines(text, cut, view.job, width)
        inputs = run_lines.input_lines(text, view.state.snapshot, width, size.height - len(rows))
        large = large_lines(text, cut, size.width)
        if size.height - len(rows) - len(inputs) > len(large):
            inputs = [*inputs, *([BLANK] * (size.height - len(rows) - len(inputs) - len(large))), *large]
        self._values.show([*rows, *inputs], values_title(text, view.state.age_s(view.now_s)))
        if cut is self._drawn:
            return
        self._drawn = cut
        band = error_band(cut)
        room = self._moment.size.width
        moment = [*adjust_line(text, cut, adjusts, room), *moment_lines(text, cut, band, room)]
        self._moment.show(moment if room >= LEAST_WIDTH else [], text("run_page.program"))
        unit_um, unit = text.units.size("um"), text.units.unit("um")
        series, limits = band_series(cut, band, unit_um)
        self._errors.show(TracePicture(series=series, x_limits=FULL_TURN_DEG, y_limits=limits, y_unit=unit))
        if roomy:
            self._show_polar(cut, view.state.alignment.jaw)

    def _show_polar(self, cut: CutProgress, jaw: JawAngle | None) -> None:
        angles_deg, errors_um = mean_error_um(cut)
        # A tool that is too far in leaves too small a radius.
        trace = PolarTrace(angle_deg=angles_deg, deviation_um=-errors_um, token=Token.AFTER)
        marks = [] if jaw is None else [AngleMark(angle_deg=jaw.angle_deg, label="1")]
        units = self._ui.text.units
        self._polar.show([trace] if cut.judged else [], marks=marks, unit_um=units.size("um"))
        scale = units.format_short(self._polar.scale_um_per_division, "um")
        entitle(self._polar, self._ui.text("run_page.polar", scale=scale))

    def _show_end(self, cut: CutProgress, view: View) -> None:
        text, machine = self._ui.text, self._ui.machine.machine
        figures = run_lines.figure_lines(text, cut, min(self._left.size.width, WIDEST_FACT))
        room = self._left.size.height
        figures = figures if len(figures) <= room else [row for row in figures if row != BLANK]
        self._left.show(clip_lines(figures, room, text("panel.more")), text("run_page.figures"))
        after = run_lines.after_lines(text, view.state, view.work, machine, self._right.size.width)
        self._right.show(
            clip_lines(after, self._right.size.height, text("panel.more")), text("run_page.what_next")
        )

    def _show_stop(self, view: View) -> None:
        text, state, size = self._ui.text, view.state, self._left.size
        how = stop_lines(text, state, min(size.width, WIDEST_FACT), size.height)
        self._left.show(how, text("run_page.stopped"))
        width, cut = min(self._right.size.width, WIDEST_FACT), cut_of_stop(state)
        if cut is None:
            spindle = spindle_line(text, state.spindle_rpm, width)
            rows = [spindle, BLANK, *wrap_line(text("run_page.no_cut"), width)]
            self._right.show(rows, text("run_page.values"))
        else:
            self._right.show(live_lines(text, cut, view.job, width), text("run_page.last_values"))

    def _show_lost(self, view: View) -> None:
        text, state, size = self._ui.text, view.state, self._left.size
        lost = lost_lines(text, state, view.now_s, min(size.width, WIDEST_FACT), size.height)
        self._left.show(lost, text("run_page.lost.title"))
        width, cut, age_s = min(self._right.size.width, WIDEST_FACT), cut_of_stop(state), state.age_s(view.now_s)
        old = cut is not None and age_s is not None
        title = text("run_page.old_values", age=f"{age_s:.0f}") if old else text("run_page.values")
        rows = [line(dim(NOTHING))] if cut is None else stale(live_lines(text, cut, view.job, width))
        self._right.show(rows, title)
