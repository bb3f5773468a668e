"""Page Inspect: release the part, measure it, and compare it with the part before compensation."""

from __future__ import annotations

import sys

from textual.containers import Horizontal, Vertical

from console.session.data.trace_folder import export_trace
from console.session.station.commands import CorrectTouchOff, Measure
from console.session.station.state import Activity, MeasuredPart, StationState
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import BLANK, Line, Sheet, clipped, line, wrapped
from console.tui.page import ChartPage
from console.tui.pages import inspect_lines
from console.tui.pages.learn_lines import cause_lines, in_scatter, is_kept, learn_lines, learn_title, reason_lines
from console.tui.pages.learning_keys import accept_part, revert_version
from console.tui.pages.lobe_lines import is_taken, lobe_lines
from console.tui.pages.stop_lines import mark_lines
from console.tui.pages.trace_chooser import ANSWERS, TraceChooser
from console.tui.plot.polar_view import Mark, PolarTrace, PolarView
from console.tui.refusals.inspect_reasons import inspect_reasons
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from profiles.files import printable
from profiles.problem import Problem

_BORDER_ROWS = 2
_STEP_ROWS = 2
STEPS = {"inspect.up": -1, "inspect.down": 1, "inspect.first": -sys.maxsize, "inspect.last": sys.maxsize}
PAGES = {"inspect.page_up": -1, "inspect.page_down": 1}
WORSE = ("learned.diverges", "learned.harmonic_diverges")  # reasons to revert
MADE_WORSE = "learned.worse"  # a reason to check the set-up: reverting would not help
ELSEWHERE = "learned.lobe_elsewhere"  # a reason to check the set-up before anything is kept


class InspectPage(ChartPage):
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

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        palette = ui.palette
        self._polar = PolarView(palette=palette, id="inspect-polar")
        self._caption = Sheet(palette, id="inspect-caption")
        self._result = Sheet(palette, id="inspect-result", classes="panel")
        self._harmonics = Sheet(palette, id="inspect-harmonics", classes="panel")
        self._roundness = Vertical(self._polar, self._caption, id="inspect-roundness", classes="panel")
        numbers = Vertical(self._result, self._harmonics, id="inspect-numbers")
        self._charts = Horizontal(self._roundness, numbers, id="inspect-charts")
        self._learn = Sheet(palette, id="inspect-learn", classes="panel")
        self._message = Sheet(palette, id="inspect-message")
        self._chooser = TraceChooser(ui)
        self.panels = (self._charts, self._learn, self._message, self._chooser)
        self.texts = (self._caption, self._result, self._harmonics, self._learn, self._message)
        self._seen: inspect_lines.Comparison | None = None
        self._parts: tuple[MeasuredPart | None, MeasuredPart | None] = (None, None)
        self._harmonics.border_title = ui.text("inspect_page.harmonics")
        self._charts.display = self._learn.display = False

    def news(self, view: View) -> tuple[object, ...]:
        """Return the job, the measured parts and the blank."""
        state, parts = view.state, (id(view.state.measured), id(view.state.uncompensated))
        return id(view.work), parts, state.cut_done, state.simulated, state.marks_mm

    def act(self, action: str) -> None:
        """Measure the part, keep its learning step or revert, or continue with the next one."""
        if self.ui.answers(self.why_not(action, self.ui.view)):
            return
        if self._chooser.is_open:
            with self.ui.answering():
                self._choose(action)
        elif action == "inspect.measure":
            self._measure()
        elif action == "inspect.offset":
            self._correct()
        elif action == "inspect.import":
            with self.ui.answering():
                self._import()
        elif action == "inspect.export":
            with self.ui.answering():
                self._export()
        elif action == "inspect.accept":
            with self.ui.answering():
                accept_part(self.ui)
        elif action == "inspect.revert":
            with self.ui.answering():
                revert_version(self.ui)
        elif action == "inspect.next":
            self.ui.go(PageName.ALIGN)

    def show(self, view: View) -> None:
        """Show the newest state; also the trace chooser, in the place of everything else."""
        opened = self._chooser.is_open
        if self._chooser.display is not opened:
            self._chooser.display = opened
            self._charts.display = self._learn.display = self._message.display = False
            self._painted_for = []
        if opened:
            self._chooser.refresh_choice(view)
        else:
            super().show(view)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why nothing can be measured, kept, read or written now; in the trace chooser, what it lacks."""
        if self._chooser.is_open:
            return self._chooser.why_not(action)
        return inspect_reasons(action, view)

    @property
    def field(self) -> FieldKind:
        """Free text while a path is typed."""
        return FieldKind.TEXT if self._chooser.is_typing else FieldKind.NONE

    def leave(self) -> None:
        """Close the trace chooser."""
        self._chooser.close()

    def next_step(self, view: View) -> Line:
        """Return what comes next: cut, measure, or the next part."""
        if self._chooser.is_open:
            return self._chooser.next_step()
        return line((self.ui.text(f"inspect_page.{_next_word(view)}"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what is wrong with the last part, and its learning step or why none; or how to get a part."""
        text, part = self.ui.text, view.state.measured
        if self._chooser.is_open:
            return self._chooser.in_full(width)
        if part is None:
            return self._message_lines(view.state, width)
        wrong, learning = inspect_lines.wrong_lines(part, text, width), part.learning
        if part.lobe is not None:
            return [*wrong, *lobe_lines(part.lobe, view.work, text, width)]
        taught = [] if learning is None else learn_lines(learning, view.work, text, width, failed=_fails(part))
        return [*wrong, *taught]

    def _correct(self) -> None:
        """Correct the touch-off by the diameter of the part; the station refuses for the same reasons."""
        self.ui.control.post(CorrectTouchOff())

    def _import(self) -> None:
        """Open the trace chooser, at rest and with a job."""
        self._chooser.open()

    def _choose(self, action: str) -> None:
        if action == "inspect.import":
            self._chooser.close()
        elif action in STEPS:
            self._chooser.step(STEPS[action])
        elif action in PAGES:
            self._chooser.step(PAGES[action] * self._chooser.page_rows)
        elif action in ANSWERS:
            self._chooser.answer(action)
        elif action == "inspect.path":
            self._chooser.type_path()
        else:
            self._chooser.take()

    def _export(self) -> None:
        """Write the trace of the part to a file of its own."""
        part = self.ui.control.state.measured
        assert part is not None
        path = export_trace(self.ui.data, part.trace, job=part.job.name)
        self.ui.say("trace.exported", value=printable(str(path)))

    def _measure(self) -> None:
        """Measure the part; the station refuses for the same reasons."""
        self.ui.control.post(Measure())

    def paint(self, view: View) -> None:
        """Show the last part that was measured; not under the trace chooser, which may have opened since."""
        if self._chooser.is_open:
            return
        state = view.state
        self._compare(state)
        part = state.measured
        learning = part is not None and (part.learning is not None or part.lobe is not None)
        if self._learn.display is not learning:
            self._learn.display = learning
            self.set_class(learning, "-learning")
            self.call_after_refresh(self.paint_again)
        self.see(self._message if self._seen is None else self._charts, (self._charts, self._message))
        if self._seen is None:
            self._message.show(self._message_lines(state, max(self._message.size.width, 1)))
            return
        self._show_step(view)
        seen, text, scale = self._seen, self.ui.text, self._polar.scale_um_per_division
        self._caption.show(inspect_lines.caption_lines(seen, scale, text, self._caption.size.width))
        self._result.show(inspect_lines.result_lines(seen, state.simulated, text, *self._result.size))
        self._harmonics.show(inspect_lines.harmonic_lines(seen, text, *self._harmonics.size))

    def _show_step(self, view: View) -> None:
        """Show what can be learned from the part, or the lobe that a plain one has."""
        part, text, room = view.state.measured, self.ui.text, self._learn.size
        if part is not None and part.lobe is not None:
            rows = lobe_lines(part.lobe, view.work, text, max(room.width, 1))
            self._learn.show(clipped(rows, room.height, text("panel.more")), text("inspect_page.lobe_title"))
            self._learn.styles.min_height = min(len(rows) + _BORDER_ROWS, max(self.size.height // 2, 1))
            return
        if part is None or part.learning is None:
            return
        rows = learn_lines(part.learning, view.work, text, max(room.width, 1), failed=_fails(part), brief=True)
        more = text("panel.more") if len(rows) > room.height else ""
        self._learn.show(rows[: room.height], learn_title(part.learning, text), more)
        # Why nothing is learned from a part is shown in full, at the cost of the plot.
        width = max(room.width, 1)
        reasons = len(reason_lines(part.learning, text, width))
        if _fails(part) and (causes := cause_lines(part.learning, text, width, brief=True)):
            reasons += len(causes) + _STEP_ROWS  # and the learning step stays in sight
        self._learn.styles.min_height = min(reasons + _BORDER_ROWS, max(self.size.height // 2, 1))

    def _compare(self, state: StationState) -> None:
        parts = (state.measured, state.uncompensated)
        if parts[0] is self._parts[0] and parts[1] is self._parts[1]:
            return
        self._parts, self._seen = parts, inspect_lines.compared(state)
        if self._seen is not None:
            self._draw(self._seen)

    def _draw(self, seen: inspect_lines.Comparison) -> None:
        figures = inspect_lines.named(seen.part.result, self.ui.text)
        self._roundness.border_title = self.ui.text("inspect_page.roundness", figures=figures)
        self._result.border_title = figures
        sides = ((seen.before, Token.BEFORE, True), (seen.after, Token.AFTER, False))
        traces = [
            PolarTrace(angle_deg=side.angle_deg, deviation_um=side.profile_um, token=token, dashed=dashed)
            for side, token, dashed in sides
            if side is not None
        ]
        marks = [Mark(angle_deg=seen.part.jaw_1_deg, label="1")] if seen.part.phase_known else []
        self._polar.show(traces, marks=marks)

    def _message_lines(self, state: StationState, width: int) -> list[Line]:
        text = self.ui.text
        lines = wrapped(text("inspect_page.nothing"), width)
        what = "how_measure" if state.cut_done else "how_cut"
        how = wrapped(text(f"inspect_page.{what}{_where(state)}"), width)
        return [*lines, BLANK, *how, *mark_lines(text, state.marks_mm, width, "inspect_page")]


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
        if is_taken(part.lobe, view.work):
            return "next_lobe_taken"
        return "next_lobe" if part.lobe is not None and not part.lobe.reasons else "next_no_lobe"
    learning = part.learning
    teaches, kept = learning is not None and not learning.reasons, is_kept(learning, view.work)
    codes = [] if learning is None else [reason.code for reason in learning.reasons]
    if MADE_WORSE in codes:
        return "next_made_worse"
    if any(code in WORSE for code in codes):
        return "next_worse"
    if kept:
        return "next_half" if part.is_half else "next_kept"
    taught = None if learning is None or not teaches else learning.taught
    if taught is not None and any(warning.code == ELSEWHERE for warning in taught.warnings):
        return "next_check_jaw"
    # Clamping scatter alone is no reason to stay, for a part that passes.
    stands_out = taught is not None and not in_scatter(taught)
    if part.is_half:
        return "next_half_learn" if stands_out else "next_half"
    if not _fails(part):
        if stands_out:
            return "next_part_learn"
        if part.diameter_passes is False:
            return "next_diameter" if part.offset_taken else "next_offset"
        return "next_part"
    if taught is None:
        return "next_failed"
    return "next_failed_learn" if stands_out else "next_failed_scatter"


def _fails(part: MeasuredPart) -> bool:
    """Whether a part is out of its job's tolerance; one with half its compensation is not judged."""
    return not part.is_half and part.result.ront_um > part.job.roundness_tolerance_um
