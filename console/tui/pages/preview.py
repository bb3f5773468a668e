"""Page Preview: what a job will do on the machine, before anything is sent to it."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from textual.containers import Horizontal, Vertical
from textual.events import Resize

from console.session.cut.alignment import Alignment, problems
from console.session.cut.compensated_cut import chosen_problems
from console.session.cut.interlocks import of_lobe
from console.session.learning.learning_steps import scatter_um
from console.session.stages import Stage, without_half
from console.session.station.state import StationState
from console.session.work import Work, with_strategy
from console.text.catalogue import Catalogue
from console.text.job_words import band_reasons
from console.tui.keymap import DIGITS, PageName
from console.tui.lines import BLANK, NOTHING, Line, Sheet, clip_lines, dim, hanging, justify_line, line, wrap_line
from console.tui.page import ChartPage
from console.tui.pages import preview_lines
from console.tui.pages.learn_lines import chosen_words
from console.tui.pages.learning_keys import (
    say_what_does_not_hold,
    step_compensation,
    step_response,
    step_stage,
    why_no_compensation,
    why_no_response,
)
from console.tui.pages.run_lines import window_words
from console.tui.plot.frame import nice_limits
from console.tui.plot.polar_view import AngleMark, PolarTrace, PolarView
from console.tui.plot.surface_map import SurfaceMap, SurfaceMapView
from console.tui.plot.trace_view import Series, TracePicture, TraceView
from console.tui.theme import Palette, Token
from console.tui.ui_context import UiContext, View
from drivers.cutting.strategy import UNCOMPENSATED, Strategy
from drivers.preview.band import predicted_band
from drivers.preview.outlook import Outlook
from drivers.preview.preview import PartialPreview, surface_left
from profiles.axis.envelope import highest_safe_speed
from profiles.axis.response import ResponseSource, ServoResponse
from profiles.compensations.next_version import half_width_um_pp
from profiles.files import printable
from profiles.findings import Finding, Severity
from profiles.forecast import LEAST_FORECAST_UM, forecast_um, is_below_forecast
from profiles.job import NO_LOBE, Job
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile
from profiles.problem import Problem

_FULL_TURN = (0.0, 360.0)
_TURN_DEG = np.arange(361.0)
_SCROLL_PAGES = 0.5
_VALUE_CELLS = 9
_NEXT_LIMITS = 2  # limits that are named beside the lowest


def roundness_traces(seen: PartialPreview, strategy: Strategy) -> list[PolarTrace]:
    """Return the predicted roundness without compensation and, on top, with this strategy.

    Each is from its program; until that exists, from its closed form, if there is one. Where the path was learned
    from a part, it is the lobe expected from that part.
    """
    traces: list[PolarTrace] = []
    if seen.job.lobe_error_source == NO_LOBE:
        return traces
    for which, token in ((UNCOMPENSATED, Token.BEFORE), (strategy, Token.AFTER)):
        made = preview_lines.find_prediction(seen, which)
        if made is None or (token is Token.AFTER and not strategy.traits.follows_lobe):
            continue
        angle_deg, left_um = made.angle_deg, made.residual_um
        told = None if token is Token.BEFORE else preview_lines.by_part(seen, which)
        if told is not None:
            angle_deg, left_um = _TURN_DEG, told.lobe.at_um(_TURN_DEG)
        dashed = token is Token.BEFORE
        traces.append(PolarTrace(angle_deg=angle_deg, deviation_um=left_um, token=token, dashed=dashed))
    return traces


def path_series(seen: PartialPreview, strategy: Strategy, unit_um: float) -> list[Series]:
    """Return the target path of the tool tip, and the command of this strategy, infeed in units of `unit_um`."""
    series = [Series(x=_TURN_DEG, y=seen.target.at_um(_TURN_DEG) / unit_um, token=Token.WANTED)]
    made = preview_lines.find_prediction(seen, strategy)
    if made is not None:
        series.append(Series(x=made.angle_deg, y=made.command_um / unit_um, token=Token.COMMAND, dashed=True))
    return series


def known_of(work: Work | None) -> PartialPreview | None:
    """Return what is known of the job so far."""
    return None if work is None else work.preview or work.outlook


class ProgramView(Sheet):
    """The rows of one program; `scroll_pages` moves through them."""

    def __init__(self, palette: Palette, text: Catalogue, *, id: str | None = None) -> None:
        super().__init__(palette, id=id)
        self._text = text
        self._shown: tuple[PartialPreview, Strategy] | None = None
        self._first = 0

    def show_program(self, seen: PartialPreview, strategy: Strategy) -> None:
        """Show the program of a strategy; another one begins at its top."""
        before, self._shown = self._shown, (seen, strategy)
        if before is None or before[0].strategies.get(before[1]) is not seen.strategies.get(strategy):
            self._first = 0
        self._lay()

    def scroll(self, action: str) -> None:
        """Move by half the height of the panel, or to an end of the program."""
        half, all_of_it = round(_SCROLL_PAGES * self.size.height), sys.maxsize
        ways = {"preview.up": -half, "preview.down": half, "preview.first": -all_of_it, "preview.last": all_of_it}
        self._first += ways[action]
        self._lay()

    def on_resize(self, event: Resize) -> None:
        """Lay the rows out for the new size."""
        self._lay()

    def _lay(self) -> None:
        if self._shown is None:
            return
        rows = preview_lines.program_rows(*self._shown, self._text, self.size.width)
        height = max(self.size.height, 1)
        self._first = min(max(self._first, 0), max(len(rows) - height, 0))
        last = min(self._first + height, len(rows))
        title = self._text("preview_page.program", strategy=self._shown[1].value)
        place = self._text("preview_page.rows", first=self._first + 1, last=last, all=len(rows))
        self.show(rows[self._first : last], title, place)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimit:
    """The speed of the job and the limits of its machine for it, rpm; `binding` is the name of the lowest."""

    asked_rpm: float
    limits_rpm: Mapping[str, float]
    binding: str

    @property
    def highest_rpm(self) -> int:
        """The highest safe speed, rounded down."""
        return math.floor(self.limits_rpm[self.binding])

    @property
    def is_exceeded(self) -> bool:
        """Whether the job turns faster."""
        return self.asked_rpm > self.limits_rpm[self.binding]


class SpeedLimits:
    """Cache of the last limit, which takes some milliseconds; the page asks for it whenever it is painted."""

    def __init__(self) -> None:
        self._found: tuple[Job, MachineProfile, ServoResponse, SpeedLimit] | None = None

    def limit_for(self, seen: Outlook) -> SpeedLimit:
        """Return the limits of a job on its machine, with the response that its cut inverts."""
        found, asked = self._found, (seen.job, seen.machine, seen.response)
        if found is None or any(a is not b for a, b in zip(found[:3], asked, strict=True)):
            limits, binding = highest_safe_speed(*asked)
            limit = SpeedLimit(asked_rpm=seen.job.spindle_speed_rpm, limits_rpm=limits, binding=binding)
            found = self._found = (*asked, limit)
        return found[3]


def speed_line(limit: SpeedLimit, text: Catalogue, width: int) -> Line:
    """Return the speed of the job against its highest safe one, and what limits that."""
    token = Token.WARNING if limit.is_exceeded else Token.TEXT
    value = f"{limit.asked_rpm:.0f} / {limit.highest_rpm} rpm"
    mark = "! " if limit.is_exceeded else ""
    words = f" {mark}{value} {text(f'speed_limit.{limit.binding}')}"
    return justify_line(line(dim(text("preview_page.highest_speed"))), line((words, token)), width)


def why_lines(
    work: Work, seen: PartialPreview, strategy: Strategy, limit: SpeedLimit, text: Catalogue, width: int
) -> list[Line]:
    """Return why the predicted residual is a band, what limits the speed, and what is inverted."""
    rows = [*_band_lines(work, seen, strategy, text, width), BLANK, *_speed_lines(limit, text, width)]
    return [*rows, BLANK, *_response_lines(seen.response, seen.job.lobe_frequency_hz, text, width)]


def span_of(work: Work, seen: PartialPreview, strategy: Strategy) -> preview_lines.Span | None:
    """Return the limits of the remaining error: by the model, or by the part that a learned path is from."""
    if work.stage == Stage.AIR:
        return None
    if _is_learned(work):
        return _span_by_part(work, seen, strategy)
    band = predicted_band(seen, strategy)
    return None if band is None else (forecast_um(band.low_um), forecast_um(band.high_um))


def _is_learned(work: Work) -> bool:
    return work.compensation is not None and not work.compensation.is_model


def _span_by_part(work: Work, seen: PartialPreview, strategy: Strategy) -> preview_lines.Span | None:
    """Return the limits by the confidence of the part's lobe and the scatter of two clampings; None if unknown."""
    told, part = preview_lines.by_part(seen, strategy), work.compensation.part if work.compensation else None
    if told is None or told.ront_um is None or part is None:
        return None
    half_um = half_width_um_pp(part.lobe_sd_um, scatter_um(seen.job, seen.machine))
    return forecast_um(told.ront_um - half_um), forecast_um(told.ront_um + half_um)


def _band_lines(work: Work, seen: PartialPreview, strategy: Strategy, text: Catalogue, width: int) -> list[Line]:
    """Return the contributions to the band, largest first, or why there is no band."""
    if strategy not in seen.strategies and not _is_learned(work):
        return wrap_line(text("preview_page.computing"), width, Token.DIM)
    span = span_of(work, seen, strategy)
    if span is None or seen.job.lobe_error_source == NO_LOBE:
        return wrap_line(text("preview_page.no_band"), width, Token.DIM)
    low, high = (text.units.figure(each, "um", 1) for each in span)
    rows = wrap_line(
        text("preview_page.why_band", low=low, high=high, strategy=strategy.value), width, Token.STRONG
    )
    found = sorted(_reasons(work, seen, strategy, text), key=lambda each: -1.0 if each[0] is None else each[0])
    for um, words in reversed(found):
        value = NOTHING if um is None else text.units.figure(um, "um", 2)
        rows += hanging(dim(f"{value:>{_VALUE_CELLS - 4}} {text.units.unit('um')} "), words, width)
    combined = "combined_learned" if _is_learned(work) else "combined"
    rows += wrap_line(text(f"preview_page.{combined}"), width, Token.DIM)
    left_um = preview_lines.calculated_um(seen, strategy)
    if left_um is not None and is_below_forecast(left_um):
        left, least = (text.units.figure(each, "um", 2) for each in (left_um, LEAST_FORECAST_UM))
        rows += wrap_line(text("preview_page.forecast", calculated=left, least=least), width)
    return rows


def _reasons(
    work: Work, seen: PartialPreview, strategy: Strategy, text: Catalogue
) -> list[tuple[float | None, str]]:
    """Return each contribution, um p-p (None is not known), in words."""
    part = work.compensation.part if work.compensation is not None and _is_learned(work) else None
    if part is not None:
        of_part = half_width_um_pp(part.lobe_sd_um, 0.0)
        of_clamping = half_width_um_pp(0.0, scatter_um(seen.job, seen.machine))
        return [(of_part, text("band.part")), (of_clamping, text("band.clampings"))]
    band = predicted_band(seen, strategy)
    if band is None:
        return []
    return [(um, words) for _, um, words in band_reasons(band, seen.response, text)]


def _speed_lines(limit: SpeedLimit, text: Catalogue, width: int) -> list[Line]:
    """Return the highest safe speed, what limits it, and what would limit it next."""
    rows = wrap_line(
        text("preview_page.why_speed", rpm=limit.highest_rpm, limit=text(f"speed_limit.{limit.binding}")),
        width,
        Token.WARNING if limit.is_exceeded else Token.STRONG,
    )
    following = sorted(limit.limits_rpm.items(), key=lambda each: each[1])[1 : 1 + _NEXT_LIMITS]
    said = " · ".join(f"{rpm:.0f} rpm {text(f'speed_limit.{name}')}" for name, rpm in following)
    return [*rows, *wrap_line(text("preview_page.next_limits", limits=said), width, Token.DIM)]


def _response_lines(response: ServoResponse, frequency_hz: float, text: Catalogue, width: int) -> list[Line]:
    """Return what the command inverts, and how well that is known."""
    percent = f"{100.0 * response.relative_95(frequency_hz):.1f}"
    if response.source is ResponseSource.MODEL:
        return wrap_line(text("preview_page.inverts_model", percent=percent), width)
    facts = {
        "name": printable(response.name, 60),
        "low": f"{response.lowest_hz:g}",
        "high": f"{response.highest_hz:g}",
        "amplitude": text.units.figure(response.amplitude_um or 0.0, "um", 0),
        "percent": percent,
    }
    return wrap_line(text("preview_page.inverts_identified", **facts), width)


class PreviewPage(ChartPage):
    """Predicted roundness, tool path, margins and strategies; or the program itself."""

    name_ = PageName.PREVIEW

    DEFAULT_CSS = """
    PreviewPage {
        layout: vertical;
        #preview-charts { layout: horizontal; height: 1fr; }
        #preview-left { width: 45%; height: 1fr; }
        #preview-right { width: 1fr; height: 1fr; }
        #preview-roundness { height: 1fr; }
        #preview-caption { width: 16; height: 1fr; }
        #preview-figures { height: 1fr; }
        #preview-worst { height: 1; }
        #preview-path, #preview-map { height: 1fr; }
        #preview-map { display: none; }
        #preview-strategy { height: 8; }
        #preview-margins { height: 10; }
        #preview-program, #preview-message { height: 1fr; }
        #preview-message { padding: 1 2; }
    }
    PreviewPage.-roomy #preview-strategy { height: 12; }
    PreviewPage.-tall #preview-strategy { height: 18; }
    PreviewPage.-tall #preview-margins { height: 16; }
    PreviewPage.-tall #preview-map, PreviewPage.-mapping #preview-map { display: block; }
    PreviewPage.-mapping #preview-path, PreviewPage.-mapping #preview-margins { display: none; }
    PreviewPage.-bare #preview-roundness, PreviewPage.-bare #preview-path { display: none; }
    PreviewPage.-bare #preview-strategy, PreviewPage.-bare #preview-margins { height: 1fr; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        text, palette = ui.text, ui.palette
        self._polar = PolarView(palette=palette, id="preview-polar")
        self._caption = Sheet(palette, id="preview-caption")
        self._strategy = Sheet(palette, id="preview-strategy", classes="panel")
        self._path = TraceView(palette=palette, id="preview-path", classes="panel")
        self._margins = Sheet(palette, id="preview-margins", classes="panel")
        self._worst = Sheet(palette, id="preview-worst")
        figures = Horizontal(self._polar, self._caption, id="preview-figures")
        self._roundness = Vertical(figures, self._worst, id="preview-roundness", classes="panel")
        self._map = SurfaceMapView(palette=palette, id="preview-map", classes="panel")
        self._program = ProgramView(palette, text, id="preview-program")
        self._program.add_class("panel")
        self._message = Sheet(palette, id="preview-message")
        self._charts = Horizontal(
            Vertical(self._roundness, self._strategy, id="preview-left"),
            Vertical(self._map, self._path, self._margins, id="preview-right"),
            id="preview-charts",
        )
        self.panels = (self._charts, self._program, self._message)
        self.texts = (self._caption, self._worst, self._strategy, self._margins, self._message)
        self._reading = False
        self._speeds = SpeedLimits()
        self._in_full: tuple[tuple[Work, bool, int], list[Line]] | None = None
        self._drawn: tuple[PartialPreview, Strategy] | None = None
        self._roundness.border_subtitle = text("preview_page.roundness_as")
        self._strategy.border_title = text("preview_page.strategies")
        self._path.border_title = text("preview_page.path")
        self._path.border_subtitle = text("preview_page.path_key")
        self._margins.border_title = text("preview_page.margins")
        self._map.border_title = text("preview_page.map", unit=text.units.unit("mm"))
        self._charts.display = self._program.display = False

    def news(self, view: View) -> tuple[object, ...]:
        """Return the job and the alignment."""
        return id(view.work), id(view.state.alignment)

    def act(self, action: str) -> None:
        """Select the next strategy, compensation or stage, open or close the program, scroll in it."""
        if self.ui.answers(self.why_not(action, self.ui.view)):
            return
        if action in _CHOICES:
            with self.ui.answering():
                _CHOICES[action](self.ui)
            if self._view is not None:
                self.show(replace(self._view, work=self.ui.work))
        elif action == "preview.program":
            self._reading = not self._reading
            self.paint_again()
        elif action == "preview.map":
            self.toggle_class("-mapping")
            self.paint_again()
        else:
            self._program.scroll(action)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why a choice cannot be made: no job, no version of it; and why nothing scrolls."""
        if view.work is None:
            return (Problem(code="screen.nothing_to_cut"),)
        if action == "preview.learned":
            state = view.state
            return why_no_compensation(view.work, self.ui.data, simulated=state.simulated, lathe=state.lathe)
        if action == "preview.response":
            return why_no_response(view.work, self.ui.data, simulated=view.state.simulated)
        if action in _CHOICES or action in ("preview.program", "preview.map") or self._reading:
            return ()
        return (Problem(code="screen.program_closed"),)

    def next_step(self, view: View) -> Line:
        """Return what comes next: mostly the alignment, and the cut where that is valid."""
        text, work = self.ui.text, view.work
        if work is None:
            return line((text("preview_page.next_job"), Token.ACTION))
        seen, strategy = known_of(work), Strategy(work.strategy)
        if seen is None:
            words = text(f"preview_page.{_waiting_word(work)}")
        elif chosen_problems(work, simulated=view.state.simulated, lathe=view.state.lathe):
            words = text("preview_page.next_choose")
        elif preview_lines.is_refused(seen, strategy):
            words = text("preview_page.next_refused")
        elif strategy not in seen.strategies:
            words = text("preview_page.next_wait")
        elif not of_lobe(work.job, self.ui.machine.machine, strategy, simulated=view.state.simulated).holds:
            words = text("preview_page.next_lobe")
        elif self._reading:
            words = text("preview_page.next_program")
        else:
            aligned = not problems(view.state.alignment, work.job)
            words = _next_words(text, work, seen, "run" if aligned else "align")
        return line((words, Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return why the chosen compensation does not apply, the findings, and what explains the prediction."""
        work, kept = view.work, self._in_full
        if work is None:
            return []
        # Called at each tick while the list is open, and the band takes some ten milliseconds.
        asked = (work, view.state.simulated, width)
        if kept is None or kept[0][0] is not work or kept[0][1:] != asked[1:]:
            kept = self._in_full = asked, self._lines_in_full(work, width, simulated=view.state.simulated)
        return kept[1]

    def _lines_in_full(self, work: Work, width: int, *, simulated: bool) -> list[Line]:
        text, seen, strategy = self.ui.text, known_of(work), Strategy(work.strategy)
        chosen = chosen_problems(work, simulated=simulated, lathe=self.ui.control.state.lathe)
        found = () if seen is None else preview_lines.findings_of(seen, strategy)
        aside = [Finding(severity=Severity.WARNING, problem=problem) for problem in work.set_aside]
        against = preview_lines.problem_lines((*chosen, *work.preview_problems), text, width)
        rows = [*against, *preview_lines.finding_lines((*aside, *found), text, width)]
        if seen is None:
            return rows
        return [
            *rows,
            *([BLANK] if rows else []),
            *why_lines(work, seen, strategy, self._speeds.limit_for(seen), text, width),
        ]

    def leave(self) -> None:
        """Show the charts again for when the operator comes back."""
        if self._reading:
            self._reading = False
            self.paint_again()

    def paint(self, view: View) -> None:
        """Show the preview of the open job."""
        work, seen, text = view.work, known_of(view.work), self.ui.text
        if work is None or seen is None:
            self.see(self._message, self.panels)
            self._message.show(
                clip_lines(self._message_lines(view), self._message.size.height, text("panel.more"))
            )
            return
        strategy = Strategy(work.strategy)
        if self._reading:
            self.see(self._program, self.panels)
            self._program.show_program(seen, strategy)
        else:
            self.see(self._charts, self.panels)
            self._draw(seen, strategy)
            self._write(seen, strategy, view.state.alignment, span_of(work, seen, strategy))
            told = "roundness_by_part" if preview_lines.by_part(seen, strategy) else "roundness_as"
            self._roundness.border_subtitle = text(f"preview_page.{told}")
            self._strategy.border_subtitle = self._chosen_words(work, view.state)

    def _chosen_words(self, work: Work, state: StationState) -> str:
        against = chosen_problems(work, simulated=state.simulated, lathe=state.lathe)
        key = "made_not" if against else "made_aside" if work.set_aside else "made"
        return self.ui.text(f"preview_page.{key}", made=chosen_words(self.ui.text, work))

    def _message_lines(self, view: View) -> list[Line]:
        text, width = self.ui.text, max(self._message.size.width, 1)
        if view.work is None:
            return wrap_line(text("preview_page.no_job"), width)
        if view.work.preview_problems:
            return preview_lines.problem_lines(view.work.preview_problems, text, width)
        return wrap_line(text("preview_page.computing"), width)

    def _draw(self, seen: PartialPreview, strategy: Strategy) -> None:
        """Draw the plots, once for each preview and strategy."""
        if self._drawn is not None and self._drawn[0] is seen and self._drawn[1] is strategy:
            return
        self._drawn = (seen, strategy)
        marks = [AngleMark(angle_deg=seen.job.jaw_1_deg, label="1")]
        units = self.ui.text.units
        self._polar.show(roundness_traces(seen, strategy), marks=marks, unit_um=units.size("um"))
        series = path_series(seen, strategy, units.size("um"))
        low, high = (float(edge(np.concatenate([each.y for each in series]))) for edge in (np.min, np.max))
        limits = nice_limits(low, high)
        picture = TracePicture(
            series=series, x_limits=_FULL_TURN, y_limits=limits, y_unit=units.unit("um"), x_unit="°"
        )
        self._path.show(picture)
        surface = surface_left(seen, strategy)
        if surface is None:
            self._map.show(SurfaceMap(z_mm=(), angle_deg=(), deviation_um=()))
        else:
            left_um = surface.residual_um + surface.mean_um[:, None]
            self._map.show(
                SurfaceMap(
                    z_mm=surface.z_mm,
                    angle_deg=surface.angle_deg,
                    deviation_um=left_um,
                    worst=surface.worst,
                    marks=marks,
                    units=units,
                )
            )

    def _write(
        self, seen: PartialPreview, strategy: Strategy, alignment: Alignment, band: preview_lines.Span | None
    ) -> None:
        text, scale = self.ui.text, self._polar.scale_um_per_division
        width, window = max(self._caption.size.width, 1), window_words(seen.job, seen.machine, self.ui.text)
        caption = preview_lines.roundness_caption(seen, strategy, alignment, scale, text, width, band)
        self._caption.show(caption)
        self._roundness.border_title = text(
            "preview_page.roundness", z=text.units.show(middle_mm(seen.job), "mm", 1)
        )
        self._worst.show([preview_lines.worst_line(seen, strategy, text)])
        self._strategy.show(preview_lines.strategy_lines(seen, strategy, text, *self._strategy.size))
        needs = preview_lines.margins(seen, strategy, text.units)
        size = self._margins.size
        rows = preview_lines.margin_lines(needs, text, size.width, size.height - 1, window)
        self._margins.show(
            [*rows, speed_line(self._speeds.limit_for(seen), text, size.width)][: max(size.height, 0)]
        )


def _step_strategy(ui: UiContext) -> None:
    """Select the next strategy. A version learned with another one stays chosen, and does not apply; report it."""
    work = ui.work
    if work is not None:
        names = [each.value for each in Strategy]
        ui.work = with_strategy(work, names[(names.index(work.strategy) + 1) % len(names)])
        say_what_does_not_hold(ui)


_CHOICES: dict[str, Callable[[UiContext], None]] = {
    "preview.strategy": _step_strategy,
    "preview.learned": step_compensation,
    "preview.response": step_response,
    "preview.stage": step_stage,
}


def _waiting_word(work: Work) -> str:
    """Return what to do while there is nothing to show: wait, or change what cannot be predicted."""
    if not work.preview_problems:
        return "next_wait"
    return "next_problem" if work.inverts is None else "next_problem_response"


def _next_words(text: Catalogue, work: Work, seen: PartialPreview, page: str) -> str:
    """Return the kind of cut, where that needs a word, and what comes next: the findings, then a page."""
    found, word = preview_lines.findings_of(seen, Strategy(work.strategy)), _next_word(work, seen)
    opens, digit = text(f"preview_page.opens_{page}"), DIGITS[PageName(page)]
    if word == "next_modelled":
        return text("preview_page.next_findings" if found else f"preview_page.{word}", opens=opens)
    then = text("preview_page.then_findings", digit=digit) if found else opens
    return f"{text(f'preview_page.{word}')} {then}"


def _next_word(work: Work, seen: PartialPreview) -> str:
    if work.stage == Stage.AIR:
        return f"next_air{without_half(Strategy(work.strategy))}"
    if work.stage != Stage.FULL:
        return "next_half"
    if work.job.lobe_error_source == NO_LOBE:
        return "next_plain"
    if work.set_aside:
        return "next_aside"
    return "next_modelled" if preview_lines.by_part(seen, Strategy(work.strategy)) is None else "next_learned"
