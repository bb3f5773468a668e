"""Page Inspect: release the part, measure it, and compare it with the part before compensation."""

from __future__ import annotations

from collections.abc import Callable

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.events import Resize
from textual.geometry import Size

from console.session.station.commands import Measure
from console.session.station.state import Activity, MeasuredPart, StationState
from console.tui.keymap import PageName
from console.tui.lines import BLANK, Line, Sheet, line, wrapped
from console.tui.page import Page
from console.tui.pages.inspect_lines import (
    Comparison,
    caption_lines,
    compared,
    harmonic_lines,
    mark_lines,
    named,
    result_lines,
    wrong_lines,
)
from console.tui.pages.learn_lines import in_scatter, is_kept, learn_lines, learn_title, reason_lines
from console.tui.pages.learning_keys import accept_lesson, revert_version
from console.tui.plot.polar_view import Mark, PolarTrace, PolarView
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.problem import Problem, ProblemError

ROWS_FOR_PLOTS = 16
"""Rows of the page below which the table replaces the plot."""

_ROOMY_ROWS, _TALL_ROWS = 22, 36
_BORDER_ROWS = 2
_JAW_1 = "1"

WORSE = ("learned.diverges", "learned.wave_diverges")
"""Reasons to revert."""

MADE_WORSE = "learned.worse"
"""A reason to check the set-up: reverting would not help."""

ELSEWHERE = "learned.lobe_elsewhere"
"""A reason to check the set-up before anything is kept."""


class InspectPage(Page):
    """Before and after on one scale, with every figure as a number beside it."""

    name_ = PageName.INSPECT

    DEFAULT_CSS = """
    InspectPage {
        layout: vertical;
        .panel { border: round $secondary; border-title-color: $foreground; }
        #inspect-charts { layout: horizontal; height: 1fr; }
        #inspect-roundness { width: 58%; height: 1fr; }
        #inspect-numbers { width: 1fr; height: 1fr; }
        #inspect-polar { height: 1fr; }
        #inspect-caption { height: 3; }
        #inspect-result { width: 1fr; height: 10; }
        #inspect-harmonics { width: 1fr; height: 1fr; }
        #inspect-message { height: 1fr; padding: 1 2; }
        #inspect-learn { height: 4; }
    }
    InspectPage.-learning #inspect-result { height: 8; }
    InspectPage.-roomy #inspect-result { height: 14; }
    InspectPage.-roomy #inspect-learn { height: 6; }
    InspectPage.-roomy.-learning #inspect-result { height: 10; }
    InspectPage.-tall #inspect-learn { height: 8; }
    InspectPage.-tall.-learning #inspect-result { height: 14; }
    InspectPage.-bare #inspect-roundness { display: none; }
    InspectPage.-bare #inspect-numbers { layout: horizontal; }
    InspectPage.-bare #inspect-result { height: 1fr; }
    """

    def __init__(self, desk: UiContext) -> None:
        super().__init__(desk)
        palette = desk.palette
        self._polar = PolarView(palette=palette, id="inspect-polar")
        self._caption = Sheet(palette, id="inspect-caption")
        self._result = Sheet(palette, id="inspect-result", classes="panel")
        self._harmonics = Sheet(palette, id="inspect-harmonics", classes="panel")
        self._roundness = Vertical(self._polar, self._caption, id="inspect-roundness", classes="panel")
        self._charts = Horizontal(id="inspect-charts")
        self._learn = Sheet(palette, id="inspect-learn", classes="panel")
        self._message = Sheet(palette, id="inspect-message")
        self._view: View | None = None
        self._seen: Comparison | None = None
        self._parts: tuple[MeasuredPart | None, MeasuredPart | None] = (None, None)
        self._painted_for: tuple[Size, ...] = ()
        self._harmonics.border_title = desk.text("inspect_page.harmonics")
        self._charts.display = self._learn.display = False

    def compose(self) -> ComposeResult:
        """Return the plot with its numbers, and a message in their place."""
        with self._charts:
            yield self._roundness
            yield Vertical(self._result, self._harmonics, id="inspect-numbers")
        yield self._learn
        yield self._message

    def show(self, view: View) -> None:
        """Show the last part that was measured."""
        before, self._view = self._view, view
        news = before is None or before.work is not view.work or _news(before.state) != _news(view.state)
        if news or self._sizes != self._painted_for:
            self._paint()

    def fit(self) -> None:
        """Show plots where there is room for them."""
        height = self.size.height
        self.set_class(height < ROWS_FOR_PLOTS, "-bare")
        self.set_class(height >= _ROOMY_ROWS, "-roomy")
        self.set_class(height >= _TALL_ROWS, "-tall")

    def on_resize(self, event: Resize) -> None:
        """Adapt to the new size."""
        self.fit()
        self.call_after_refresh(self._paint)

    def act(self, action: str) -> None:
        """Measure the part, keep its learning step or revert, or continue with the next one."""
        if action == "inspect.measure":
            self._measure()
        elif action == "inspect.accept":
            self._learned(accept_lesson)
        elif action == "inspect.revert":
            self._learned(revert_version)
        elif action == "inspect.next":
            self.desk.go(PageName.ALIGN)

    def next_step(self, view: View) -> Line:
        """Return what comes next: cut, measure, or the next part."""
        return line((self.desk.text(f"inspect_page.{_next_word(view)}"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what is wrong with the last part, and its learning step or why none; or how to get a part."""
        text, part = self.desk.text, view.state.measured
        if part is None:
            return self._message_lines(view.state, width)
        lesson = part.lesson
        taught = [] if lesson is None else learn_lines(lesson, view.work, text, width, failed=_fails(part))
        return [*wrong_lines(part, text, width), *taught]

    def _learned(self, key: Callable[[UiContext], None]) -> None:
        """Perform the action of a key of the panel Learn, or show why not."""
        try:
            key(self.desk)
        except ProblemError as error:
            self.desk.said = tuple(error.problems)

    def _measure(self) -> None:
        state = self.desk.control.state
        reason = _refusal(state)
        if reason is not None:
            self.desk.said = (reason,)
            return
        self.desk.control.post(Measure())

    def _paint(self) -> None:
        view = self._view
        if view is None:
            return
        self._painted_for = self._sizes
        state = view.state
        self._compare(state)
        lesson = None if state.measured is None else state.measured.lesson
        self._see(self._message if self._seen is None else self._charts, learning=lesson is not None)
        if self._seen is None:
            self._message.show(self._message_lines(state, max(self._message.size.width, 1)))
            return
        self._show_lesson(view)
        seen, text, caption = self._seen, self.desk.text, self._caption.size
        result, harmonics = self._result.size, self._harmonics.size
        scale = self._polar.scale_um_per_division
        self._caption.show(caption_lines(seen, scale, text, caption.width))
        self._result.show(result_lines(seen, state.simulated, text, result.width, result.height))
        self._harmonics.show(harmonic_lines(seen, text, harmonics.width, harmonics.height))

    def _show_lesson(self, view: View) -> None:
        part = view.state.measured
        if part is None or part.lesson is None:
            return
        text, room = self.desk.text, self._learn.size
        rows = learn_lines(part.lesson, view.work, text, max(room.width, 1), failed=_fails(part))
        self._learn.show(rows[: room.height])
        self._learn.border_title = learn_title(part.lesson, text)
        self._learn.border_subtitle = text("panel.more") if len(rows) > room.height else ""
        # Why nothing is learned from a part is shown in full, at the cost of the plot.
        reasons = len(reason_lines(part.lesson, text, max(room.width, 1)))
        self._learn.styles.min_height = min(reasons + _BORDER_ROWS, max(self.size.height // 2, 1))

    def _compare(self, state: StationState) -> None:
        """Evaluate and draw, once for each pair of parts."""
        parts = (state.measured, state.uncompensated)
        if parts[0] is self._parts[0] and parts[1] is self._parts[1]:
            return
        self._parts, self._seen = parts, compared(state)
        if self._seen is not None:
            self._draw(self._seen)

    def _draw(self, seen: Comparison) -> None:
        figures = named(seen.part.result, self.desk.text)
        self._roundness.border_title = self.desk.text("inspect_page.roundness", figures=figures)
        self._result.border_title = figures
        sides = [(seen.before, Token.BEFORE)]
        if seen.after is not None:
            sides.append((seen.after, Token.AFTER))
        traces = [
            PolarTrace(
                angle_deg=side.angle_deg, deviation_um=side.profile_um, token=token, dashed=token is Token.BEFORE
            )
            for side, token in sides
        ]
        self._polar.show(traces, marks=[Mark(angle_deg=seen.part.jaw_1_deg, label=_JAW_1)])

    @property
    def _sizes(self) -> tuple[Size, ...]:
        """Return the sizes of the texts; a new class changes them some time after the resize."""
        sheets = (self._caption, self._result, self._harmonics, self._learn, self._message)
        return tuple(sheet.size for sheet in sheets)

    def _see(self, target: Horizontal | Sheet, *, learning: bool) -> None:
        """Show the numbers with their learning step, or the message; each needs a layout before it has a size."""
        if target.display and self._learn.display is learning:
            return
        for each in (self._charts, self._message):
            each.display = each is target
        self._learn.display = learning
        self.set_class(learning, "-learning")
        if self.is_attached:
            self.call_after_refresh(self._paint)

    def _message_lines(self, state: StationState, width: int) -> list[Line]:
        text = self.desk.text
        lines = wrapped(text("inspect_page.nothing"), width)
        what = "how_measure" if state.cut_done else "how_cut"
        return [
            *lines,
            BLANK,
            *wrapped(text(f"inspect_page.{what}{_where(state)}"), width),
            *mark_lines(state.marks_mm, text, width),
        ]


def _where(state: StationState) -> str:
    """Return the suffix for texts about measuring here, or elsewhere: only a simulated machine has a gauge."""
    return "" if state.simulated else "_outside"


def _next_word(view: View) -> str:
    """Return the word for what comes next: air, half, whole; learning; the next part."""
    state, part = view.state, view.state.measured
    if state.activity is Activity.MEASURING:
        return "next_wait"
    if part is None:
        if state.cut is not None and state.cut.in_air and not state.cut_done:
            return "next_air"
        return ("next_measure" if state.cut_done else "next_cut") + _where(state)
    if not part.strategy.traits.follows_lobe:
        return "next_compensate"
    lesson = part.lesson
    teaches, kept = lesson is not None and not lesson.reasons, is_kept(lesson, view.work)
    codes = [] if lesson is None else [reason.code for reason in lesson.reasons]
    if MADE_WORSE in codes:
        return "next_made_worse"
    if any(code in WORSE for code in codes):
        return "next_worse"
    if kept:
        return "next_half" if part.is_half else "next_kept"
    taught = None if lesson is None or not teaches else lesson.taught
    if taught is not None and any(warning.code == ELSEWHERE for warning in taught.warnings):
        return "next_check_jaw"
    # Clamping scatter alone is no reason to stay, for a part that passes.
    stands_out = taught is not None and not in_scatter(taught)
    if part.is_half:
        return "next_half_learn" if stands_out else "next_half"
    if not _fails(part):
        return "next_part_learn" if stands_out else "next_part"
    if taught is None:
        return "next_failed"
    return "next_failed_learn" if stands_out else "next_failed_scatter"


def _fails(part: MeasuredPart) -> bool:
    """Whether a part is out of its job's tolerance; one with half its compensation is not judged."""
    return not part.is_half and part.result.ront_um > part.job.roundness_tolerance_um


def _news(state: StationState) -> tuple[object, ...]:
    """Return what this page shows of a state; parts are immutable and compared by identity."""
    return id(state.measured), id(state.uncompensated), state.cut_done, state.simulated, state.marks_mm


def _refusal(state: StationState) -> Problem | None:
    """Return why no part can be measured now; the station refuses for the same reasons."""
    if not state.simulated:
        return Problem(code="session.no_gauge")
    if state.moving:
        return Problem(code="machine.moving")
    if not state.cut_done:
        return Problem(code="session.nothing_cut")
    return None
