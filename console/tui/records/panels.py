"""The panels of the page Records, one for each kind of content, and their scrolling."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import StrEnum

import numpy as np
from textual.containers import Horizontal, Vertical
from textual.geometry import Size
from textual.widget import Widget

from console.session.learning.evaluated_part import EvaluatedPart
from console.session.learning.job_chart import ChartedQuantity, JobChart, NoClaim
from console.session.learning.opened_run import OpenedRun
from console.text.along_length import ront_words
from console.text.catalogue import Catalogue
from console.text.recorded_words import local, part_words
from console.tui.lines import (
    BLANK,
    NOTHING,
    Line,
    Sheet,
    clip_lines,
    dim,
    entitle,
    fit_text,
    hanging,
    justify_line,
    line,
    name_in,
    to_the_right,
    wrap_line,
)
from console.tui.pages.preview_lines import AFTER_KEY, BEFORE_KEY
from console.tui.plot.frame import nice_limits
from console.tui.plot.polar_view import AngleMark, PolarTrace, PolarView
from console.tui.plot.run_chart_view import ChartPicture, Level, RunChartView
from console.tui.plot.stack_view import PartMapView, StackView
from console.tui.plot.trace_view import Series, TracePicture, TraceView
from console.tui.records.background_reader import Problems
from console.tui.records.list_lines import RunList, hidden_words, nothing_lines, run_lines, title_words
from console.tui.records.reading import ListQuery, OpenedRuns, RunListing
from console.tui.records.run_lines import jaw_harmonics, made_of, story_lines
from console.tui.rows import problem_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext
from console.units import Units
from profiles.files import printable
from profiles.metrology.process_statistics import LEAST_CHART, LEAST_PARTS, LEAST_TREND, Capability
from profiles.metrology.unrolled import UnrolledPart, unroll_kept
from profiles.strict_values import number, number_or_none

Found = RunListing | OpenedRuns | JobChart | Problems | None
_PAGE_LEAST = 1
_LABEL_LEAST = 13  # columns
_MARKS = {True: "✓", False: "✗", None: "·"}
MOST_NAMED = 8  # parts beyond the limits that are named


class RecordsView(StrEnum):
    """Mode of the page."""

    LIST = "list"
    RUN = "run"
    CUT = "cut"
    PROGRAM = "program"
    PAIR = "pair"
    CHART = "chart"
    LENGTH = "length"


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


def kept_part(run: OpenedRun) -> UnrolledPart | None:
    """Return the sections of the part of a run as they were kept; None without any."""
    return None if run.product is None else unroll_kept(run.product.data)


def polar_of(
    traces: Sequence[tuple[EvaluatedPart | None, Token, bool]],
) -> tuple[list[PolarTrace], list[AngleMark]]:
    """Return the plotted traces, each turned so that jaw 1 is at the angle of the last one's."""
    shown = [(trace, token, dashed) for trace, token, dashed in traces if trace is not None]
    jaw_1_deg = shown[-1][0].jaw_1_deg if shown else None
    polar = [
        PolarTrace(
            angle_deg=trace.turn.angle_deg + _turn_deg(trace, jaw_1_deg),
            deviation_um=trace.profile_um,
            token=token,
            dashed=dashed,
        )
        for trace, token, dashed in shown
    ]
    return polar, [] if jaw_1_deg is None else [AngleMark(angle_deg=jaw_1_deg, label="1")]


def _turn_deg(trace: EvaluatedPart, jaw_1_deg: float | None) -> float:
    return 0.0 if jaw_1_deg is None or trace.jaw_1_deg is None else jaw_1_deg - trace.jaw_1_deg


def pair_caption(pair: OpenedRuns, um_per_division: float, text: Catalogue, width: int) -> list[Line]:
    """Return the legend of the two traces, and their scale."""
    rows = []
    for run, key in zip(pair.runs, (BEFORE_KEY, AFTER_KEY), strict=True):
        part = run.story.product
        ront = ront_words(None if part is None else part.ront_um, text)
        token = Token.BEFORE if run is pair.runs[0] else Token.AFTER
        rows.append(
            justify_line(line((key, token), f" {local(run.story.row.started)}"), line((f" {ront}", token)), width)
        )
    scale = text("inspect_page.scale", value=text.units.format_short(um_per_division, "um"))
    traces = [run.evaluated(run.product) for run in pair.runs]
    untied = any(trace is not None and trace.jaw_1_deg is None for trace in traces)
    note = text("records_page.not_turned") if untied else text("records_page.turned")
    return [*rows, justify_line(line(dim(note)), line(dim(" " + scale)), width)]


def pair_lines(pair: OpenedRuns, text: Catalogue, width: int) -> list[Line]:
    """Return the table of both runs, the most important rows first."""
    column = max((width - _LABEL_LEAST) // 2, 8)
    label = max(width - 2 * column, 1)
    rows = []
    for name, values in _rows(pair, text):
        cells = "".join(to_the_right(name_in(value, column - 1), column) for value in values)
        same = values[0] == values[1]
        rows.append(line(dim(fit_text(name, label)), (cells, Token.DIM if same else Token.TEXT)))
    return rows


def _rows(pair: OpenedRuns, text: Catalogue) -> list[tuple[str, tuple[str, str]]]:
    """Return each row of the table with the values of both."""
    marked, other = (_values(run, text) for run in pair.runs)
    names = [*marked, *(name for name in other if name not in marked)]
    return [(name, (marked.get(name, NOTHING), other.get(name, NOTHING))) for name in names]


def _values(run: OpenedRun, text: Catalogue) -> dict[str, str]:
    row, part, job, units = run.story.row, run.story.product, run.job, text.units
    values = {units.unit("um"): local(row.started)[5:], text("fact.job"): printable(row.job)}
    if part is not None:
        worst_um, z_mm = part.worst
        ront = NOTHING if worst_um is None else units.figure(worst_um, "um", 2)
        values["RONt"] = f"{ront} {_MARKS[part.passed]}"
        if z_mm is not None:
            values[f"RONt: Z {units.unit('mm')}"] = units.figure(z_mm, "mm", 1)
        for name in ("RONp", "RONv", "RONq"):
            values[name] = _format_number(part.data.get(f"{name}_um"), lambda value: units.figure(value, "um", 2))
        if part.diameter_mm is not None:
            values[f"D {units.unit('mm')}"] = units.figure(part.diameter_mm, "mm", 3)
        harmonics = {text("inspect_page.harmonic", n=n): um_pp for n, um_pp in jaw_harmonics(part, run)}
        values |= {name: units.figure(um_pp, "um", 2) for name, um_pp in harmonics.items()}
    values[text("records_page.ended")] = text.first_sentence(
        f"records_page.how.{row.ended.how}", f"records.how.{row.ended.how}"
    )
    values[text("fact.made")] = made_of(row, text)
    values[text("records_page.force_n")] = _format_number(run.story.setup.get("force_n"), _one)
    values[f"{text('fact.jaw')} °"] = _format_number(run.story.setup.get("jaw_1_deg"), _one)
    if job is not None:
        values["rpm"] = f"{job.spindle_speed_rpm:.0f}"
        values[text("records_page.depth_mm")] = units.figure(job.depth_of_cut_mm, "mm", 3)
    values[text("records_page.of.alarms")] = str(len(run.story.alarms))
    values[text("fact.machine")] = printable(row.machine)
    values[text("fact.operator")] = printable(row.operator or NOTHING)
    return values


def _one(value: float) -> str:
    return f"{value:.1f}"


def _format_number(value: object, form: Callable[[float], str]) -> str:
    try:
        return form(number(value))
    except (TypeError, ValueError):
        return NOTHING


def chart_picture(chart: JobChart, units: Units) -> ChartPicture:
    """Return the drawing of a chart in these units; RONt has no limit below 0."""
    size, begins = units.size("um"), float(chart.numbers[chart.begins]) if chart.numbers else 0.0
    levels = [
        Level(value=value / size, name="tol", token=Token.WARNING)
        for value in (chart.lower_um, chart.upper_um)
        if value is not None
    ]
    if chart.limits is not None:
        found = chart.limits
        if chart.figure is not ChartedQuantity.RONT or found.lower > 0.0:
            levels.append(Level(value=found.lower / size, name="LCL", token=Token.DIM, begins=begins, dashed=True))
        levels.append(Level(value=found.upper / size, name="UCL", token=Token.DIM, begins=begins, dashed=True))
        levels.append(Level(value=found.mean / size, name="avg", token=Token.RING, begins=begins))
    values = [each / size for each in chart.values_um]
    return ChartPicture(
        numbers=chart.numbers,
        values=values,
        beyond=chart.places_beyond_limits,
        levels=levels,
        unit=units.unit("um"),
    )


def chart_title(chart: JobChart, text: Catalogue) -> str:
    """Return whose parts are charted."""
    figure = text(f"records_page.chart.{chart.figure}")
    return f"{figure} · {printable(chart.job, 30)} · {printable(chart.strategy, 12)}"


def chart_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    """Return the statistics of a chart in words, most important first."""
    if not chart.values_um:
        said = "no_parts" if not chart.parts else "no_diameters"
        return wrap_line(text(f"records_page.chart.{said}"), width)
    lines = _limit_lines(chart, text, width)
    lines += _claim_lines(chart, text, width)
    lines += _lobe_lines(chart, text, width)
    count, dates = len(chart.values_um), {"first": _date(chart.first), "last": _date(chart.last)}
    lines += wrap_line(text("records_page.chart.parts", count=count, **dates), width, Token.DIM)
    if chart.begins:
        lines += wrap_line(text("records_page.chart.alike", count=chart.alike_count), width, Token.DIM)
    if chart.others:
        lines += wrap_line(text("records_page.chart.others", count=chart.others), width, Token.DIM)
    return lines


def _limit_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    limits = chart.limits
    if limits is None:
        few = text("records_page.chart.no_limits", count=chart.alike_count, least=LEAST_CHART)
        return wrap_line(few, width)
    found = {"mean": limits.mean, "lower": limits.lower, "upper": limits.upper}
    facts = {name: text.units.figure(value, "um", 2) for name, value in found.items()}
    if chart.figure is ChartedQuantity.RONT and limits.lower <= 0.0:
        facts["lower"] = "0"
    lines = wrap_line(text("records_page.chart.limits", **facts), width)
    if not chart.places_beyond_limits:
        return [*lines, line(dim(text("records_page.chart.none_beyond")))]
    named = [str(chart.numbers[place]) for place in chart.places_beyond_limits]
    more = "" if len(named) <= MOST_NAMED else " …"
    which = ", ".join(named[-MOST_NAMED:]) if not more else "… " + ", ".join(named[-MOST_NAMED:])
    beyond = text("records_page.chart.beyond", count=len(named), which=which)
    return [*lines, *hanging(("✗ ", Token.WARNING), beyond, width, Token.WARNING)]


def _claim_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    """Return the indices with the number of parts and their interval, or why none is claimed."""
    found = chart.capability
    if found is not None:
        return wrap_line(capability_words(found, text), width, Token.STRONG)
    facts = {"count": chart.alike_count, "least": LEAST_PARTS, "beyond": len(chart.places_beyond_limits)}
    said = text(f"records_page.chart.claim.{chart.no_claim or NoClaim.LATER}", **facts)
    return hanging(dim("Cpk – "), said, width)


def capability_words(found: Capability, text: Catalogue) -> str:
    """Return the indices of a process with their 95 % intervals and the number of parts."""
    said = []
    if found.cp is not None and found.cp_low is not None and found.cp_high is not None:
        said.append(f"Cp {found.cp:.2f} ({found.cp_low:.2f} – {found.cp_high:.2f})")
    said.append(f"Cpk {found.cpk:.2f} ({found.cpk_low:.2f} – {found.cpk_high:.2f})")
    return f"{' · '.join(said)} {text('records_page.chart.confidence', count=found.parts)}"


def _lobe_lines(chart: JobChart, text: Catalogue, width: int) -> list[Line]:
    found = chart.lobe
    if found is None:
        if chart.no_claim is NoClaim.LATER:
            return []
        few = text("records_page.chart.no_trend", least=LEAST_TREND)
        return wrap_line(few, width, Token.DIM)
    rising = "rising" if found.per_part > 0.0 else "falling"
    slope, half = text.units.figure(found.per_part, "um", 3, "+"), text.units.figure(found.half_width, "um", 3)
    facts = {"slope": slope, "half": half, "count": found.parts}
    said = text(f"records_page.chart.{rising if found.significant else 'steady'}", **facts)
    return wrap_line(said, width, Token.WARNING if found.significant and found.per_part > 0.0 else Token.TEXT)


def _date(date: object) -> str:
    from datetime import datetime

    return date.astimezone().strftime("%Y-%m-%d") if isinstance(date, datetime) and date.year > 1 else NOTHING


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
        self._stack = StackView(palette=palette, id="records-stack", classes="panel")
        self._map = PartMapView(palette=palette, id="records-map", classes="panel")
        self._along = Vertical(self._stack, self._map, id="records-along")
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
            self._along,
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

    def panel_for(self, mode: RecordsView, found: Found) -> Widget:
        """Return the panel for the content; the message panel without any."""
        if mode is RecordsView.LIST and isinstance(found, RunListing) and found.rows:
            return self._rows
        if isinstance(found, JobChart):
            return self._chart
        if not isinstance(found, OpenedRuns):
            return self._rows if mode is RecordsView.LIST and found is None else self._message
        if mode is RecordsView.CUT:
            return self._cut if found.runs[0].telemetry is not None else self._message
        if mode is RecordsView.LENGTH:
            return self._message if kept_part(found.runs[-1]) is None else self._along
        return self._program if mode is RecordsView.PROGRAM else self._run

    def page_rows(self, mode: RecordsView) -> int:
        """Return by how many rows PgUp and PgDn move."""
        panel = {
            RecordsView.LIST: self._rows,
            RecordsView.PROGRAM: self._program,
            RecordsView.CHART: self._claims,
        }.get(mode, self._run.facts)
        return max(panel.size.height - 2, _PAGE_LEAST)

    def show_list(
        self, runs: RunList | None, wanted: ListQuery, found: Found, *, everywhere: bool, typing: bool
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

    def show(self, mode: RecordsView, found: Found, top: int) -> int:
        """Show the opened runs or chart, lines from `top` on; return the first shown line."""
        text = self._text
        if isinstance(found, JobChart):
            return self._show_chart(found, top)
        if not isinstance(found, OpenedRuns):
            lines = [line(dim(text("records_page.reading")))]
            if isinstance(found, tuple):
                lines = _problem_lines(found, text, max(self._message.size.width, 1))
            self._say(lines, "")
            return 0
        run = found.runs[-1]
        if mode is RecordsView.CUT:
            return self._show_cut(run)
        if mode is RecordsView.LENGTH:
            return self._show_along(run)
        if mode is RecordsView.PROGRAM:
            lines = self._lines(found, self._program, lambda _: program_lines(run))
            return self._scroll(self._program, lines, top, text("records_page.program", time=_start_time(run)))
        if mode is RecordsView.PAIR and len(found.runs) > 1:
            return self._show_pair(found, top)
        return self._show_run(run, found, top)

    def _show_run(self, run: OpenedRun, found: OpenedRuns, top: int) -> int:
        text, panel = self._text, self._run
        others = [(found, Token.BEFORE, True) for part, found in run.traces if not part.product]
        polar, marks = polar_of([*others, (run.evaluated(run.product), Token.AFTER, False)])
        panel.set_class(not polar, "-plain")
        panel.polar.show(polar, marks=marks, unit_um=text.units.size("um"))
        entitle(panel.left, text("inspect_page.roundness", figures=evaluated_words(run, text)))
        scale = panel.polar.scale_um_per_division
        panel.caption.show(trace_caption(run, scale, text, max(panel.caption.size.width, 1)))
        lines = self._lines(found, panel.facts, lambda width: story_lines(run, text, width))
        return self._scroll(panel.facts, lines, top, _start_time(run))

    def _show_along(self, run: OpenedRun) -> int:
        part, trace = kept_part(run), run.evaluated(run.product)
        if part is None:
            self._say([line(dim(self._text("records_page.no_sections")))], _start_time(run))
            return 0
        jaw_1_deg = None if trace is None else trace.jaw_1_deg
        marks = [] if jaw_1_deg is None else [AngleMark(angle_deg=jaw_1_deg, label="1")]
        for view in (self._stack, self._map):
            view.show_part(part, marks, self._text)
        return 0

    def _show_pair(self, pair: OpenedRuns, top: int) -> int:
        text, panel = self._text, self._run
        one, other = (run.evaluated(run.product) for run in pair.runs)
        polar, marks = polar_of([(one, Token.BEFORE, True), (other, Token.AFTER, False)])
        panel.set_class(not polar, "-plain")
        panel.polar.show(polar, marks=marks, unit_um=text.units.size("um"))
        entitle(panel.left, text("records_page.both"))
        scale = panel.polar.scale_um_per_division
        panel.caption.show(pair_caption(pair, scale, text, max(panel.caption.size.width, 1)))
        lines = self._lines(pair, panel.facts, lambda width: pair_lines(pair, text, width))
        return self._scroll(panel.facts, lines, top, text("records_page.pair"))

    def _show_cut(self, run: OpenedRun) -> int:
        text, telemetry = self._text, run.telemetry
        if telemetry is None:
            self._say([line(dim(text("records_page.no_telemetry")))], _start_time(run))
            return 0
        time_s = telemetry.column("time_s")
        fed = telemetry.fed_along(math.inf if run.job is None else run.job.cut_length_mm)
        for view, name, unit in ((self._error, "tool_error_um", "um"), (self._speed, "speed_rpm", "rpm")):
            values = telemetry.column(name) / text.units.size(unit)
            values = np.where(fed, values, np.nan) if fed.any() else values  # approach and retract hide the cut
            known = values[np.isfinite(values)]
            limits = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
            part = part_words(telemetry.part, text) or run.story.row.strategy
            entitle(view, text(f"records_page.{name}", part=part))
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
        self._message.show(clip_lines(list(lines), panel.size.height, self._text("panel.more")), title, "")

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


def full_lines(mode: RecordsView, found: Found, text: Catalogue, width: int) -> list[Line]:
    """Return all text on the opened runs or chart, or why they cannot be read."""
    if isinstance(found, tuple):
        return _problem_lines(found, text, width)
    if isinstance(found, JobChart):
        return chart_lines(found, text, width)
    if not isinstance(found, OpenedRuns) or mode is RecordsView.PROGRAM:
        return []
    if mode is RecordsView.PAIR and len(found.runs) > 1:
        return pair_lines(found, text, width)
    return story_lines(found.runs[-1], text, width)


def program_lines(run: OpenedRun) -> list[Line]:
    """Return the program of a run as it was sent, with numbers of its lines."""
    rows = run.story.program.splitlines()
    return [line(dim(f"{number:>5} "), row.replace("\t", "    ")) for number, row in enumerate(rows, start=1)]


def evaluated_words(run: OpenedRun, text: Catalogue) -> str:
    """Return state, circle and filter of the figures, as they were evaluated."""
    part = run.story.product
    if part is None:
        return NOTHING
    state, upr = part.data.get("state"), part.data.get("filter_upr")
    known = f"state.{state}" if state in ("free", "clamped") else "state.unknown"
    filtered = text("inspect_page.filtered", upr=f"{upr:g}") if isinstance(upr, int | float) else NOTHING
    return " · ".join((text(known), printable(str(part.data.get("reference_circle", NOTHING)), 6), filtered))


def trace_caption(run: OpenedRun, um_per_division: float, text: Catalogue, width: int) -> list[Line]:
    """Return the legend of the traces of a run, where jaw 1 is, and the scale."""
    rows = []
    for part, _ in run.traces:
        key, token = (AFTER_KEY, Token.AFTER) if part.product else (BEFORE_KEY, Token.BEFORE)
        name = f" {printable(part.part, 20) or text('records_page.trace')}"
        rows.append(
            justify_line(line((key, token), name), line((f" {ront_words(part.ront_um, text)}", token)), width)
        )
    trace = run.evaluated(run.product)
    jaw_1_deg = number_or_none(run.story.setup.get("jaw_1_deg")) if trace is None else trace.jaw_1_deg
    jaw = "" if trace is None else text("inspect_page.jaw_unknown")
    if jaw_1_deg is not None:
        jaw = text("inspect_page.jaw", angle=f"{jaw_1_deg:.1f}")
    scale = text("inspect_page.scale", value=text.units.format_short(um_per_division, "um"))
    return [*rows[-2:], justify_line(line(dim(jaw)), line(dim(" " + scale)), width)]


def _problem_lines(problems: Problems, text: Catalogue, width: int) -> list[Line]:
    lines = problem_lines(problems, text, width, token=Token.WARNING)
    return [*lines, BLANK, *wrap_line(text("records_page.others_work"), width, Token.DIM)]


def _below_entry(lines: Sequence[Line], *, typing: bool) -> list[Line]:
    return [line(" / "), *lines] if typing else list(lines)


def _start_time(run: OpenedRun) -> str:
    return local(run.story.row.started)
