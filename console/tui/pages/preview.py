"""Page Preview: what a job will do on the machine, before anything is sent to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.events import Resize
from textual.geometry import Size

from console.session.cut.alignment import Alignment
from console.session.cut.compensated import chosen_problems
from console.session.stages import Stage
from console.session.station.state import StationState
from console.session.work import Work, with_strategy
from console.text.catalogue import Catalogue
from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, clipped, line, wrapped
from console.tui.page import Page
from console.tui.pages.learn_lines import chosen_words
from console.tui.pages.learning_keys import say_what_does_not_hold, step_compensation, step_stage
from console.tui.pages.preview_lines import (
    by_part,
    finding_lines,
    findings_of,
    foreseen,
    margin_lines,
    margins,
    problem_lines,
    refused,
    roundness_caption,
    strategy_lines,
)
from console.tui.pages.program import ProgramView
from console.tui.pages.run_lines import window_words
from console.tui.plot.polar_view import Mark, PolarTrace, PolarView
from console.tui.plot.scale import nice_limits
from console.tui.plot.trace_view import Series, TraceView
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from drivers.cutting.strategy import UNCOMPENSATED, Strategy
from drivers.preview.band import Band, predicted_band
from drivers.preview.preview import Underway
from profiles.findings import Finding, Severity
from profiles.problem import ProblemError

ROWS_FOR_PLOTS = 16
"""Rows of the page below which numbers take the room of the plots."""

_ROOMY_ROWS, _TALL_ROWS = 22, 36
_FULL_TURN = (0.0, 360.0)
_TURN_DEG = np.arange(361.0)
_SCROLL_PAGES = 0.5
_JAW_1 = "1"


def roundness_traces(seen: Underway, strategy: Strategy) -> list[PolarTrace]:
    """Return the predicted roundness without compensation and, on top, with this strategy.

    Each is from its program; until that exists, from its closed form, if there is one. Where the path was learned
    from a part, it is the lobe expected from that part.
    """
    traces = []
    for which, token in ((UNCOMPENSATED, Token.BEFORE), (strategy, Token.AFTER)):
        made = foreseen(seen, which)
        if made is None or (token is Token.AFTER and not strategy.traits.follows_lobe):
            continue
        angle_deg, left_um = made.angle_deg, made.residual_um
        told = None if token is Token.BEFORE else by_part(seen, which)
        if told is not None:
            angle_deg, left_um = _TURN_DEG, told.lobe.at_um(_TURN_DEG)
        dashed = token is Token.BEFORE
        traces.append(PolarTrace(angle_deg=angle_deg, deviation_um=left_um, token=token, dashed=dashed))
    return traces


def path_series(seen: Underway, strategy: Strategy) -> list[Series]:
    """Return the target path of the tool tip, and the command of this strategy, um of infeed."""
    series = [Series(x=_TURN_DEG, y=seen.target.at_um(_TURN_DEG), token=Token.WANTED)]
    made = foreseen(seen, strategy)
    if made is not None:
        series.append(Series(x=made.angle_deg, y=made.command_um, token=Token.COMMAND, dashed=True))
    return series


def known_of(work: Work | None) -> Underway | None:
    """Return what is known of the job so far."""
    return None if work is None else work.preview or work.outlook


class PreviewPage(Page):
    """Predicted roundness, tool path, margins and strategies; or the program itself."""

    name_ = PageName.PREVIEW

    DEFAULT_CSS = """
    PreviewPage {
        layout: vertical;
        .panel { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
        #preview-charts { layout: horizontal; height: 1fr; }
        #preview-left { width: 45%; height: 1fr; }
        #preview-right { width: 1fr; height: 1fr; }
        #preview-roundness { height: 1fr; }
        #preview-caption { width: 16; height: 1fr; }
        #preview-path { height: 1fr; }
        #preview-strategy { height: 8; }
        #preview-margins { height: 9; }
        #preview-program, #preview-message { height: 1fr; }
        #preview-message { padding: 1 2; }
    }
    PreviewPage.-roomy #preview-strategy { height: 12; }
    PreviewPage.-tall #preview-strategy { height: 18; }
    PreviewPage.-tall #preview-margins { height: 15; }
    PreviewPage.-bare #preview-roundness, PreviewPage.-bare #preview-path { display: none; }
    PreviewPage.-bare #preview-strategy, PreviewPage.-bare #preview-margins { height: 1fr; }
    """

    def __init__(self, desk: UiContext) -> None:
        super().__init__(desk)
        text, palette = desk.text, desk.palette
        self._polar = PolarView(palette=palette, id="preview-polar")
        self._caption = Sheet(palette, id="preview-caption")
        self._strategy = Sheet(palette, id="preview-strategy", classes="panel")
        self._path = TraceView(palette=palette, id="preview-path", classes="panel")
        self._margins = Sheet(palette, id="preview-margins", classes="panel")
        self._roundness = Horizontal(self._polar, self._caption, id="preview-roundness", classes="panel")
        self._charts = Horizontal(id="preview-charts")
        self._program = ProgramView(palette, text, id="preview-program")
        self._program.add_class("panel")
        self._message = Sheet(palette, id="preview-message")
        self._reading = False
        self._view: View | None = None
        self._drawn: tuple[Underway, Strategy] | None = None
        self._painted_for: tuple[Size, ...] = ()
        self._roundness.border_title = text("preview_page.roundness")
        self._roundness.border_subtitle = text("preview_page.roundness_as")
        self._strategy.border_title = text("preview_page.strategies")
        self._path.border_title = text("preview_page.path")
        self._path.border_subtitle = text("preview_page.path_key")
        self._margins.border_title = text("preview_page.margins")
        self._charts.display = self._program.display = False

    def compose(self) -> ComposeResult:
        """Return the charts, with the program and a message in their place."""
        with self._charts:
            yield Vertical(self._roundness, self._strategy, id="preview-left")
            yield Vertical(self._path, self._margins, id="preview-right")
        yield self._program
        yield self._message

    def show(self, view: View) -> None:
        """Show the preview of the open job."""
        before, self._view = self._view, view
        old = None if before is None else (before.work, before.state.alignment)
        same = old is not None and old[0] is view.work and old[1] is view.state.alignment
        if not same or self._sizes != self._painted_for:
            self._paint()

    def fit(self) -> None:
        """Show plots where there is room for them."""
        height = self.size.height
        self.set_class(height < ROWS_FOR_PLOTS, "-bare")
        self.set_class(_ROOMY_ROWS <= height < _TALL_ROWS, "-roomy")
        self.set_class(height >= _TALL_ROWS, "-tall")

    def on_resize(self, event: Resize) -> None:
        """Adapt to the new size."""
        self.fit()
        self.call_after_refresh(self._paint)

    def act(self, action: str) -> None:
        """Select the next strategy, compensation or stage, open or close the program, scroll in it."""
        if action in _CHOICES:
            self._choose(_CHOICES[action])
        elif action == "preview.program":
            self._reading = not self._reading
            self._paint()
        elif action in ("preview.up", "preview.down") and self._reading:
            self._program.scroll_pages(_SCROLL_PAGES if action == "preview.down" else -_SCROLL_PAGES)

    def _choose(self, step: Callable[[UiContext], None]) -> None:
        """Step through the choices, or show why not."""
        try:
            step(self.desk)
        except ProblemError as error:
            self.desk.said = tuple(error.problems)
        if self._view is not None:
            self.show(replace(self._view, work=self.desk.work))

    def next_step(self, view: View) -> Line:
        """Return what comes next: mostly the alignment."""
        text, work = self.desk.text, view.work
        if work is None:
            return line((text("preview_page.next_job"), Token.ACTION))
        seen, strategy = known_of(work), Strategy(work.strategy)
        if seen is None:
            words = text("preview_page.next_problem") if work.preview_problems else text("preview_page.next_wait")
        elif self._not_for_it(work, view.state):
            words = text("preview_page.next_choose")
        elif refused(seen, strategy):
            words = text("preview_page.next_refused")
        elif strategy not in seen.strategies:
            words = text("preview_page.next_wait")
        elif self._reading:
            words = text("preview_page.next_program")
        else:
            words = _next_words(text, work, seen)
        return line((words, Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return why the chosen compensation does not apply, and the findings against the job."""
        text, work = self.desk.text, view.work
        if work is None:
            return []
        seen = known_of(work)
        chosen = chosen_problems(work, simulated=view.state.simulated)
        found = [] if seen is None else finding_lines(findings_of(seen, Strategy(work.strategy)), text, width)
        aside = [Finding(severity=Severity.WARNING, problem=problem) for problem in work.set_aside]
        against = problem_lines((*chosen, *work.preview_problems), text, width)
        return [*against, *finding_lines(aside, text, width), *found]

    def _not_for_it(self, work: Work, state: StationState) -> bool:
        """Whether the job may not be cut with the chosen compensation and stage."""
        return bool(chosen_problems(work, simulated=state.simulated))

    def leave(self) -> None:
        """Show the charts again for when the operator comes back."""
        if self._reading:
            self._reading = False
            self._paint()

    def _paint(self) -> None:
        view = self._view
        if view is None:
            return
        self._painted_for = self._sizes
        work, seen, text = view.work, known_of(view.work), self.desk.text
        if work is None or seen is None:
            self._see(self._message)
            self._message.show(clipped(self._message_lines(view), self._message.size.height, text("panel.more")))
            return
        strategy = Strategy(work.strategy)
        if self._reading:
            self._see(self._program)
            self._program.show_program(seen, strategy)
        else:
            self._see(self._charts)
            self._draw(seen, strategy)
            self._write(seen, strategy, view.state.alignment, _band(work, seen, strategy))
            told = "roundness_by_part" if by_part(seen, strategy) else "roundness_as"
            self._roundness.border_subtitle = text(f"preview_page.{told}")
            self._strategy.border_subtitle = self._chosen_words(work, view.state)

    def _chosen_words(self, work: Work, state: StationState) -> str:
        """Return the compensation of the part, and whether it would be refused, or a version is set aside."""
        key = "made_not" if self._not_for_it(work, state) else "made_aside" if work.set_aside else "made"
        return self.desk.text(f"preview_page.{key}", made=chosen_words(self.desk.text, work))

    @property
    def _sizes(self) -> tuple[Size, ...]:
        """Return the sizes of the texts; a new class changes them some time after the resize."""
        return tuple(sheet.size for sheet in (self._caption, self._strategy, self._margins, self._message))

    def _see(self, target: Horizontal | Sheet) -> None:
        """Show one of the three, which needs a layout before it knows its size."""
        if target.display:
            return
        for each in (self._charts, self._program, self._message):
            each.display = each is target
        if self.is_attached:
            self.call_after_refresh(self._paint)

    def _message_lines(self, view: View) -> list[Line]:
        text, width = self.desk.text, max(self._message.size.width, 1)
        if view.work is None:
            return wrapped(text("preview_page.no_job"), width)
        if view.work.preview_problems:
            return problem_lines(view.work.preview_problems, text, width)
        return wrapped(text("preview_page.computing"), width)

    def _draw(self, seen: Underway, strategy: Strategy) -> None:
        """Draw the plots, once for each preview and strategy."""
        if self._drawn is not None and self._drawn[0] is seen and self._drawn[1] is strategy:
            return
        self._drawn = (seen, strategy)
        marks = [Mark(angle_deg=seen.job.jaw_1_deg, label=_JAW_1)]
        self._polar.show(roundness_traces(seen, strategy), marks=marks)
        series = path_series(seen, strategy)
        low, high = (float(edge(np.concatenate([each.y for each in series]))) for edge in (np.min, np.max))
        self._path.show(series, _FULL_TURN, nice_limits(low, high), "um", "°")

    def _write(self, seen: Underway, strategy: Strategy, alignment: Alignment, band: Band | None) -> None:
        text, scale = self.desk.text, self._polar.scale_um_per_division
        caption, strategies, needs = self._caption.size, self._strategy.size, self._margins.size
        self._caption.show(roundness_caption(seen, strategy, alignment, scale, text, max(caption.width, 1), band))
        self._strategy.show(strategy_lines(seen, strategy, text, strategies.width, strategies.height))
        window = window_words(seen.job, seen.machine)
        self._margins.show(margin_lines(margins(seen, strategy), text, needs.width, needs.height, window))


def _step_strategy(desk: UiContext) -> None:
    """Select the next strategy. A version learned with another one stays chosen, and does not apply; report it."""
    work = desk.work
    if work is not None:
        names = [each.value for each in Strategy]
        desk.work = with_strategy(work, names[(names.index(work.strategy) + 1) % len(names)])
        say_what_does_not_hold(desk)


_CHOICES: dict[str, Callable[[UiContext], None]] = {
    "preview.strategy": _step_strategy,
    "preview.learned": step_compensation,
    "preview.stage": step_stage,
}


def _band(work: Work, seen: Underway, strategy: Strategy) -> Band | None:
    """Return the band of the remaining error; a learned path has none, because the model knows nothing of it."""
    learned = work.compensation is not None and not work.compensation.is_model
    if learned or work.stage == Stage.AIR:
        return None
    return predicted_band(seen, strategy)


def _next_words(text: Catalogue, work: Work, seen: Underway) -> str:
    """Return the kind of cut, where that needs a word, and what comes next: the findings, then the alignment."""
    found, word = findings_of(seen, Strategy(work.strategy)), _next_word(work, seen)
    if word == "next_align":
        return text("preview_page.next_findings" if found else "preview_page.next_align")
    then = text("preview_page.then_findings" if found else "preview_page.then_align")
    return f"{text(f'preview_page.{word}')} {then}"


def _next_word(work: Work, seen: Underway) -> str:
    if work.stage != Stage.FULL:
        return "next_air" if work.stage == Stage.AIR else "next_half"
    if work.set_aside:
        return "next_aside"
    return "next_align" if by_part(seen, Strategy(work.strategy)) is None else "next_learned"
