"""The panels of the page Records: what each kind of content is shown in, and how much of it is seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum

import numpy as np
from textual.containers import Horizontal, Vertical
from textual.geometry import Size
from textual.widget import Widget

from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, Sheet, clipped, dim, entitle, hanging, line, ranged, wrapped
from console.tui.pages.preview_lines import AFTER_KEY, BEFORE_KEY
from console.tui.plot.frame import nice_limits
from console.tui.plot.polar_view import PolarView
from console.tui.plot.run_chart_view import RunChartView
from console.tui.plot.trace_view import Series, TracePicture, TraceView
from console.tui.records.beside import Problems
from console.tui.records.chart_lines import chart_lines, chart_picture, chart_title
from console.tui.records.compared_lines import Pair, pair_caption, pair_lines, polar_of
from console.tui.records.job_chart import JobChart
from console.tui.records.list_lines import RunList, hidden_words, local, nothing_lines, run_lines, title_words
from console.tui.records.listing import Listing, Wanted
from console.tui.records.opened_run import OpenedRun
from console.tui.records.reading import Opened
from console.tui.records.run_lines import story_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from profiles.files import printable

Found = Listing | Opened | JobChart | Problems | None
_PAGE_LEAST = 1


class Mode(StrEnum):
    """What the page shows."""

    LIST = "list"
    RUN = "run"
    CUT = "cut"
    PROGRAM = "program"
    PAIR = "pair"
    CHART = "chart"


class RoundnessPanel(Horizontal):
    """Roundness plot with its caption on the left, lines on the right; without traces the lines alone."""

    DEFAULT_CSS = """
    RoundnessPanel {
        height: 1fr;
        #records-left { width: 52%; height: 1fr; }
        #records-polar { height: 1fr; }
        #records-caption { height: 3; }
        #records-facts { width: 1fr; height: 1fr; }
    }
    RoundnessPanel.-plain #records-left { display: none; }
    """

    def __init__(self, ui: UiContext) -> None:
        palette = ui.palette
        self.polar = PolarView(palette=palette, id="records-polar")
        self.caption = Sheet(palette, id="records-caption")
        self.facts = Sheet(palette, id="records-facts", classes="panel")
        self.left = Vertical(self.polar, self.caption, id="records-left", classes="panel")
        super().__init__(self.left, self.facts, id="records-run")


class RecordsPanels:
    """All panels of the page; one is seen at a time."""

    def __init__(self, ui: UiContext) -> None:
        palette = ui.palette
        self._text = ui.text
        self._rows = Sheet(palette, id="records-list", classes="panel")
        self._run = RoundnessPanel(ui)
        self._error = TraceView(palette=palette, id="records-error", classes="panel")
        self._speed = TraceView(palette=palette, id="records-speed", classes="panel")
        self._cut = Vertical(self._error, self._speed, id="records-cut")
        self._program = Sheet(palette, id="records-program", classes="panel")
        self._view = RunChartView(palette=palette, id="records-view", classes="panel")
        self._claims = Sheet(palette, id="records-claims", classes="panel")
        self._chart = Vertical(self._view, self._claims, id="records-chart")
        self._message = Sheet(palette, id="records-message", classes="panel")
        for sheet in (self._rows, self._program, self._message):
            sheet.styles.height = "1fr"
        self.all: Sequence[Widget] = (
            self._rows,
            self._run,
            self._cut,
            self._program,
            self._chart,
            self._message,
        )
        for panel in self.all[1:]:
            panel.display = False
        self._laid: tuple[object, int, list[Line]] | None = None

    @property
    def sizes(self) -> tuple[Size, ...]:
        """The sizes by which lines are broken and plots drawn."""
        panels = (self._rows, self._run.facts, self._run.caption, self._program, self._claims, self._message)
        return tuple(panel.size for panel in panels)

    def of(self, mode: Mode, found: Found) -> Widget:
        """Return the panel in which something is shown; a message where there is nothing."""
        if mode is Mode.LIST and isinstance(found, Listing) and found.rows:
            return self._rows
        if isinstance(found, JobChart):
            return self._chart
        if not isinstance(found, Opened):
            return self._rows if mode is Mode.LIST and found is None else self._message
        if mode is Mode.CUT:
            return self._cut if found.runs[0].telemetry is not None else self._message
        return self._program if mode is Mode.PROGRAM else self._run

    def page_rows(self, mode: Mode) -> int:
        """Return by how many rows PgUp and PgDn move."""
        panel = {Mode.LIST: self._rows, Mode.PROGRAM: self._program, Mode.CHART: self._claims}.get(
            mode, self._run.facts
        )
        return max(panel.size.height - 2, _PAGE_LEAST)

    def show_list(
        self, runs: RunList | None, wanted: Wanted, found: Found, *, everywhere: bool, typing: bool
    ) -> None:
        """Show the list, or why there is none."""
        text = self._text
        listing = None if runs is None else runs.listing
        title = title_words(wanted, listing, text, everywhere=everywhere)
        width = max(self._message.size.width, 1)
        if isinstance(found, tuple):
            self._say(_problem_lines(found, text, width), title)
        elif runs is None or not runs.listing.rows:
            lines = [line(dim(text("records_page.reading")))]
            if found is not None:
                lines = nothing_lines(wanted, text, width)
            self._say(_below_entry(lines, typing=typing), title)
            self._rows.show(_below_entry(lines, typing=typing), title, "")
        else:
            size = self._rows.size
            lines = run_lines(runs, text, size.width, size.height - typing, everywhere=everywhere)
            reading = text("records_page.reading") if found is None else hidden_words(runs, text, size.height)
            self._rows.show(_below_entry(lines, typing=typing), title, reading)

    def show(self, mode: Mode, found: Found, top: int) -> int:
        """Show what is open, lines from `top` on; return where they begin."""
        text = self._text
        if isinstance(found, JobChart):
            return self._show_chart(found, top)
        if not isinstance(found, Opened):
            lines = [line(dim(text("records_page.reading")))]
            if isinstance(found, tuple):
                lines = _problem_lines(found, text, max(self._message.size.width, 1))
            self._say(lines, "")
            return 0
        run = found.runs[-1]
        if mode is Mode.CUT:
            return self._show_cut(run)
        if mode is Mode.PROGRAM:
            lines = self._lines(found, self._program, lambda _: program_lines(run))
            return self._scroll(self._program, lines, top, text("records_page.program", time=_when(run)))
        if mode is Mode.PAIR and len(found.runs) > 1:
            return self._show_pair(Pair(marked=found.runs[0], other=run), found, top)
        return self._show_run(run, found, top)

    def _show_run(self, run: OpenedRun, found: Opened, top: int) -> int:
        text, panel = self._text, self._run
        others = [(each, Token.BEFORE, True) for each in run.traces if not each.part.product]
        polar, marks = polar_of([*others, (run.trace, Token.AFTER, False)])
        panel.set_class(not polar, "-plain")
        panel.polar.show(polar, marks=marks, unit_um=text.units.size("um"))
        entitle(panel.left, text("inspect_page.roundness", figures=evaluated_words(run, text)))
        scale = panel.polar.scale_um_per_division
        panel.caption.show(trace_caption(run, scale, text, max(panel.caption.size.width, 1)))
        lines = self._lines(found, panel.facts, lambda width: story_lines(run, text, width))
        return self._scroll(panel.facts, lines, top, _when(run))

    def _show_pair(self, pair: Pair, found: Opened, top: int) -> int:
        text, panel = self._text, self._run
        polar, marks = polar_of([(pair.marked.trace, Token.BEFORE, True), (pair.other.trace, Token.AFTER, False)])
        panel.set_class(not polar, "-plain")
        panel.polar.show(polar, marks=marks, unit_um=text.units.size("um"))
        entitle(panel.left, text("records_page.both"))
        scale = panel.polar.scale_um_per_division
        panel.caption.show(pair_caption(pair, scale, text, max(panel.caption.size.width, 1)))
        lines = self._lines(found, panel.facts, lambda width: pair_lines(pair, text, width))
        return self._scroll(panel.facts, lines, top, text("records_page.pair"))

    def _show_cut(self, run: OpenedRun) -> int:
        text, telemetry = self._text, run.telemetry
        if telemetry is None:
            self._say([line(dim(text("records_page.no_telemetry")))], _when(run))
            return 0
        time_s = telemetry.column("time_s")
        for view, name, unit in ((self._error, "tool_error_um", "um"), (self._speed, "speed_rpm", "rpm")):
            values = telemetry.column(name) / text.units.size(unit)
            known = values[np.isfinite(values)]
            limits = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
            entitle(view, text(f"records_page.{name}", part=telemetry.part or run.story.row.strategy))
            view.show(
                TracePicture(
                    series=(Series(x=time_s, y=values, token=Token.AFTER),),
                    x_limits=(0.0, max(float(time_s[-1]), 1.0)),
                    y_limits=nice_limits(*limits),
                    y_unit=text.units.unit(unit),
                    x_unit="s",
                )
            )
        return 0

    def _show_chart(self, chart: JobChart, top: int) -> int:
        text = self._text
        entitle(self._view, chart_title(chart, text))
        self._view.visible = bool(chart.values_um)
        self._view.show(chart_picture(chart, text.units))
        lines = self._lines(chart, self._claims, lambda width: chart_lines(chart, text, width))
        return self._scroll(self._claims, lines, top, text("records_page.chart.title"))

    def _say(self, lines: Sequence[Line], title: str) -> None:
        panel = self._message
        self._message.show(clipped(list(lines), panel.size.height, self._text("panel.more")), title, "")

    def _lines(self, found: object, panel: Sheet, make: Callable[[int], list[Line]]) -> list[Line]:
        """Return lines for a panel, made anew only for other content or another width."""
        width = max(panel.size.width, 1)
        if self._laid is None or self._laid[0] is not found or self._laid[1] != width:
            self._laid = found, width, make(width)
        return self._laid[2]

    def _scroll(self, panel: Sheet, lines: Sequence[Line], top: int, title: str) -> int:
        height = max(panel.size.height, 1)
        top = min(top, max(len(lines) - height, 0))
        seen = lines[top : top + height]
        more = "" if len(lines) <= height else f"{top + 1}-{top + len(seen)}/{len(lines)} ↑↓"
        panel.show(seen, title, more)
        return top


def full_lines(mode: Mode, found: Found, text: Catalogue, width: int) -> list[Line]:
    """Return everything that is told of what is open, or why it cannot be read."""
    if isinstance(found, tuple):
        return _problem_lines(found, text, width)
    if isinstance(found, JobChart):
        return chart_lines(found, text, width)
    if not isinstance(found, Opened) or mode is Mode.PROGRAM:
        return []
    if mode is Mode.PAIR and len(found.runs) > 1:
        return pair_lines(Pair(marked=found.runs[0], other=found.runs[1]), text, width)
    return story_lines(found.runs[-1], text, width)


def program_lines(run: OpenedRun) -> list[Line]:
    """Return the program of a run as it was sent, with numbers of its lines."""
    rows = run.story.program.splitlines()
    return [line(dim(f"{number:>5} "), row.replace("\t", "    ")) for number, row in enumerate(rows, start=1)]


def evaluated_words(run: OpenedRun, text: Catalogue) -> str:
    """Return state, circle and filter of the figures, as they were evaluated."""
    part = run.product
    if part is None:
        return NOTHING
    state, upr = part.data.get("state"), part.data.get("filter_upr")
    known = f"state.{state}" if state in ("free", "clamped") else "state.unknown"
    filtered = text("inspect_page.filtered", upr=f"{upr:g}") if isinstance(upr, int | float) else NOTHING
    return " · ".join((text(known), printable(str(part.data.get("reference_circle", NOTHING)), 6), filtered))


def trace_caption(run: OpenedRun, um_per_division: float, text: Catalogue, width: int) -> list[Line]:
    """Return the legend of the traces of a run, where jaw 1 is, and the scale."""
    rows = []
    for each in run.traces:
        part = each.part
        key, token = (AFTER_KEY, Token.AFTER) if part.product else (BEFORE_KEY, Token.BEFORE)
        name = f" {printable(part.part, 20) or text('records_page.trace')}"
        rows.append(
            ranged(line((key, token), name), line((f" {text.units.show(part.ront_um, 'um', 2)}", token)), width)
        )
    trace = run.trace
    jaw = text("inspect_page.jaw_unknown")
    if trace is not None and trace.jaw_1_deg is not None:
        jaw = text("inspect_page.jaw", angle=f"{trace.jaw_1_deg:.1f}")
    scale = text("inspect_page.scale", value=text.units.short(um_per_division, "um"))
    return [*rows[-2:], ranged(line(dim(jaw)), line(dim(" " + scale)), width)]


def _problem_lines(problems: Problems, text: Catalogue, width: int) -> list[Line]:
    lines: list[Line] = []
    for problem in problems:
        lines += hanging(("! ", Token.WARNING), text.problem(problem), width, Token.WARNING)
    return [*lines, BLANK, *wrapped(text("records_page.others_work"), width, Token.DIM)]


def _below_entry(lines: Sequence[Line], *, typing: bool) -> list[Line]:
    return [line(" / "), *lines] if typing else list(lines)


def _when(run: OpenedRun) -> str:
    return local(run.story.row.started)
