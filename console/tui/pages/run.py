"""Page Run: start conditions, arming, the progress of the cut, and how it ended.

Start needs two acts: F5 arms and shows what is about to happen, F6 starts within some seconds. Enter moves
nothing. What cannot be done now shows why.
"""

from __future__ import annotations

import math
from typing import ClassVar

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical

from console.session.cut.alignment import JawAngle
from console.session.cut.compensated import with_news
from console.session.station.commands import Arm, Disarm, EndCut, Retract, Start
from console.session.station.jogging import no_retract
from console.session.station.progress import CutProgress
from console.session.station.state import Activity, StationState
from console.tui.keymap import ACTIONS, PageName
from console.tui.lines import BLANK, NOTHING, Line, Sheet, clipped, dim, line, wrapped
from console.tui.page import Page
from console.tui.pages.cut_lines import error_series, live_lines, mean_error_um, progress_line, values_title
from console.tui.pages.run_lines import (
    after_lines,
    check_lines,
    checks,
    failing,
    figure_lines,
    input_lines,
    moves_lines,
    summary_lines,
)
from console.tui.pages.run_next import Phase, in_part, next_word, phase_of
from console.tui.pages.stop_lines import cut_of_stop, lost_lines, spindle_line, stale, stop_lines
from console.tui.plot.polar_view import Mark, PolarTrace, PolarView
from console.tui.plot.trace_view import TraceView
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from console.tui.waiting import refusal
from drivers.cutting.strategy import Strategy
from profiles.problem import Problem

FULL_TURN_DEG = (0.0, 360.0)
WIDEST_FACT = 56
"""Columns in which a label and its value are still read together."""

LEAST_WIDTH = 10
"""A narrower panel has not got its size yet: a text in it would be broken by letters."""

LEAST_POLAR_ROWS = 24
"""Rows of the page from which there is room for the polar plot below the other one."""

_KEYS = {action.id: action.shown for action in ACTIONS}


class _Across(Horizontal):
    """Panels side by side. They cover it, so it has no rows of its own to paint at every tick."""

    BLANK = True


class _Down(Vertical):
    """Panels below each other; the same."""

    BLANK = True


class RunPage(Page):
    """Page on which parts are cut."""

    BLANK = True

    name_: ClassVar[PageName] = PageName.RUN
    DEFAULT_CSS = """
    RunPage { layout: vertical; }
    RunPage #run-two, RunPage #run-live, RunPage #run-moment { height: 1fr; width: 1fr; }
    RunPage #run-live { display: none; }
    RunPage.-live #run-live { display: block; }
    RunPage.-live #run-two { display: none; }
    RunPage Sheet { width: 1fr; height: 1fr; padding: 0 1; }
    RunPage Sheet, RunPage TraceView, RunPage PolarView { border: round $secondary;
        border-title-color: $foreground; background: $background; }
    RunPage #run-left { width: 54fr; }
    RunPage #run-right { width: 46fr; }
    RunPage #run-progress { height: 3; }
    RunPage #run-values { width: 47fr; }
    RunPage #run-plots { width: 53fr; height: 1fr; }
    RunPage PolarView { display: none; }
    RunPage.-roomy PolarView { display: block; }
    """

    def __init__(self, desk: UiContext) -> None:
        super().__init__(desk)
        palette = desk.palette
        self._left = Sheet(palette, id="run-left")
        self._right = Sheet(palette, id="run-right")
        self._progress = Sheet(palette, id="run-progress")
        self._values = Sheet(palette, id="run-values")
        self._errors = TraceView(palette=palette, id="run-errors")
        self._polar = PolarView(palette=palette, id="run-polar")
        self._drawn: CutProgress | None = None
        self._view: View | None = None
        self._waits_for_room = False
        self._asked = False
        text = desk.text
        self._errors.border_title = text("run_page.errors")

    def compose(self) -> ComposeResult:
        """Return two panels of text, and the panels of a cut that take their place."""
        with _Across(id="run-two"):
            yield self._left
            yield self._right
        with _Down(id="run-live"):
            yield self._progress
            with _Across(id="run-moment"):
                yield self._values
                with _Down(id="run-plots"):
                    yield self._errors
                    yield self._polar

    def show(self, view: View) -> None:
        """Show the newest state."""
        self._view = view
        self._ask_for_news()
        phase = phase_of(view.state)
        self.set_class(phase is Phase.CUTTING, "-live")
        roomy = self.size.height >= LEAST_POLAR_ROWS
        if roomy != self.has_class("-roomy"):
            self._drawn = None  # a hidden plot has missed what was drawn
        self.set_class(roomy, "-roomy")
        panels = (self._progress, self._values) if phase is Phase.CUTTING else (self._left, self._right)
        if self._have_room(panels):
            self._fill(phase, view)

    def leave(self) -> None:
        """Mark the versions for a new check: others may learn meanwhile."""
        self._asked = False

    def _ask_for_news(self) -> None:
        """Check once, when the page is shown again, whether a newer version was accepted meanwhile."""
        work, state = self.desk.work, self.desk.control.state
        if not self._asked and work is not None:
            self._asked = True
            self.desk.work = with_news(work, self.desk.data, simulated=state.simulated)

    def _have_room(self, panels: tuple[Sheet, ...]) -> bool:
        """Whether these panels know their size. If not, they are filled as soon as they have a layout."""
        if all(panel.size.width >= LEAST_WIDTH for panel in panels):
            return True
        for panel in panels:
            panel.show([])
        if self.is_attached and not self._waits_for_room:
            self._waits_for_room = True
            self.call_after_refresh(self._show_in_room)
        return False

    def _show_in_room(self) -> None:
        if self._view is not None:
            self.show(self._view)
        self._waits_for_room = False

    def _fill(self, phase: Phase, view: View) -> None:
        cut = view.state.cut
        match phase:
            case Phase.CUTTING if cut is not None:
                self._show_cut(cut, view)
            case Phase.ENDED if cut is not None:
                self._show_end(cut, view)
            case Phase.STOPPED:
                self._show_stop(view)
            case Phase.LOST:
                self._show_lost(view)
            case _:
                self._show_before(view)

    def act(self, action: str) -> None:
        """Perform the action of a key, or show why not."""
        match action:
            case "run.arm":
                self._arm()
            case "run.start":
                self._start()
            case "run.hold":
                self._hold()
            case "run.retract":
                self._retract()

    def next_step(self, view: View) -> Line:
        """Return what to do now."""
        if view.state.activity is Activity.LOST:
            return line((self.desk.text("frame.lost"), Token.ACTION))
        word, token = next_word(view, self.desk.machine.machine)
        armed = view.state.armed
        left_s = 0 if armed is None else max(math.ceil(armed.until_s - view.now_s), 0)
        return line((self.desk.text(f"run_page.next.{word}", left=left_s), token))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what was armed, what is missing for a start, or what to do after a stop or a cut."""
        text, state, machine = self.desk.text, view.state, self.desk.machine.machine
        facts = min(width, WIDEST_FACT)
        match phase_of(state):
            case Phase.LOST:
                return lost_lines(text, state, view.now_s, width)
            case Phase.STOPPED if state.stop is not None:
                return stop_lines(text, state, facts)
            case Phase.ENDED:
                return after_lines(text, state, view.work, machine, width)
            case Phase.CUTTING:
                return []
        moves = [] if state.armed is None else moves_lines(text, state.armed, machine, width)
        rows = [] if view.work is None else summary_lines(text, state, view.work, view.now_s, facts)
        inputs = input_lines(text, state.snapshot, width)
        return [*moves, *check_lines(text, checks(state, view.work, machine), width), *inputs, *rows]

    def _arm(self) -> None:
        state, work = self.desk.control.state, self.desk.work
        if state.armed is not None:
            self.desk.control.post(Disarm())
            return
        if self._refuses(state, "run.arm"):
            return
        reasons = failing(checks(state, work, self.desk.machine.machine))
        if reasons:
            self.desk.said = reasons
        elif work is not None:
            # The record must not name a file as the source of a job that differs from it.
            sha256 = f"{work.loaded.sha256} edited" if work.edited else work.loaded.sha256
            order = Arm(
                job=work.job,
                job_sha256=sha256,
                strategy=Strategy(work.strategy),
                loaded=None if work.edited else work.loaded,
                compensation=work.compensation,
                stage=work.stage,
            )
            self.desk.control.post(order)

    def _start(self) -> None:
        state = self.desk.control.state
        if state.armed is None or self.desk.control.now_s() > state.armed.until_s:
            self._say("screen.not_armed")
        elif not self._refuses(state, "run.start"):
            self.desk.control.post(Start())

    def _hold(self) -> None:
        state = self.desk.control.state
        if state.activity is not Activity.CUTTING or state.cut is None:
            self._say("screen.nothing_to_hold")
        elif state.cut.holding:
            self._say("screen.holding_already")
        else:
            self.desk.control.post(EndCut())

    def _retract(self) -> None:
        state = self.desk.control.state
        if self._refuses(state, "run.retract"):
            return
        refused = no_retract(state.snapshot, self.desk.machine.machine, state.alignment)
        if refused is not None:
            self.desk.said = (refused,)
        elif in_part(state, self.desk.machine.machine) is False:
            self._say("screen.tool_is_out")
        else:
            self.desk.control.post(Retract())

    def _show_before(self, view: View) -> None:
        text, state, work = self.desk.text, view.state, view.work
        machine, size = self.desk.machine.machine, self._left.size
        found = checks(state, work, machine)
        moves: list[Line] = []
        if state.armed is not None:
            moves = [*moves_lines(text, state.armed, machine, size.width), BLANK]
        inputs = input_lines(text, state.snapshot, size.width, size.height - len(moves))
        room = size.height - len(moves) - len(inputs)
        self._left.show([*moves, *check_lines(text, found, size.width, room), *inputs])
        width = self._right.size.width
        if work is None:
            self._right.show(wrapped(text("run_page.no_job"), width))
        else:
            rows = summary_lines(text, state, work, view.now_s, min(width, WIDEST_FACT))
            self._right.show(clipped(rows, self._right.size.height, text("panel.more")))
        ready = text("run_page.armed_title") if state.armed is not None else text("run_page.summary")
        self._titled(text("run_page.checks"), ready)

    def _show_cut(self, cut: CutProgress, view: View) -> None:
        text = self.desk.text
        job = None if view.work is None else view.work.job
        self._progress.show([progress_line(text, cut, self._progress.size.width)])
        where = text("run_page.cut_in_air" if cut.in_air else "run_page.cut")
        if self._progress.border_title != where:
            self._progress.border_title = where
        size, snapshot = self._values.size, view.state.snapshot
        width = min(size.width, WIDEST_FACT)
        rows = live_lines(text, cut, job, width)
        self._values.show([*rows, *input_lines(text, snapshot, width, size.height - len(rows))])
        title = values_title(text, view.state.age_s(view.now_s))
        if self._values.border_title != title:
            self._values.border_title = title
        if cut is self._drawn:
            return
        self._drawn = cut
        series, limits = error_series(cut)
        self._errors.show(series, FULL_TURN_DEG, limits, "um")
        if self.has_class("-roomy"):
            self._show_polar(cut, view.state.alignment.jaw)

    def _show_polar(self, cut: CutProgress, jaw: JawAngle | None) -> None:
        angles_deg, errors_um = mean_error_um(cut)
        # A tool that is too far in leaves too small a radius.
        trace = PolarTrace(angle_deg=angles_deg, deviation_um=-errors_um, token=Token.AFTER)
        traces = [trace] if cut.judged else []
        self._polar.show(traces, marks=[] if jaw is None else [Mark(angle_deg=jaw.angle_deg, label="1")])
        title = self.desk.text("run_page.polar", scale=f"{self._polar.scale_um_per_division:g}")
        if self._polar.border_title != title:
            self._polar.border_title = title

    def _show_end(self, cut: CutProgress, view: View) -> None:
        text, machine = self.desk.text, self.desk.machine.machine
        self._left.show(figure_lines(text, cut, min(self._left.size.width, WIDEST_FACT)))
        after = after_lines(text, view.state, view.work, machine, self._right.size.width)
        self._right.show(clipped(after, self._right.size.height, text("panel.more")))
        self._titled(text("run_page.figures"), text("run_page.what_next"))

    def _show_stop(self, view: View) -> None:
        text, state = self.desk.text, view.state
        if state.stop is None:
            return
        rpm = state.spindle_rpm
        size = self._left.size
        self._left.show(stop_lines(text, state, min(size.width, WIDEST_FACT), size.height))
        width, cut = min(self._right.size.width, WIDEST_FACT), cut_of_stop(state)
        if cut is None:
            self._right.show([spindle_line(text, rpm, width), BLANK, *wrapped(text("run_page.no_cut"), width)])
            self._titled(text("run_page.stopped"), text("run_page.values"))
        else:
            self._right.show(live_lines(text, cut, None if view.work is None else view.work.job, width))
            self._titled(text("run_page.stopped"), text("run_page.last_values"))

    def _show_lost(self, view: View) -> None:
        text, state = self.desk.text, view.state
        size = self._left.size
        self._left.show(lost_lines(text, state, view.now_s, min(size.width, WIDEST_FACT), size.height))
        width, cut = min(self._right.size.width, WIDEST_FACT), cut_of_stop(state)
        job = None if view.work is None else view.work.job
        self._right.show([line(dim(NOTHING))] if cut is None else stale(live_lines(text, cut, job, width)))
        age_s = state.age_s(view.now_s)
        right = text("run_page.values")
        if cut is not None and age_s is not None:
            right = text("run_page.old_values", age=f"{age_s:.0f}")
        self._titled(text("run_page.lost.title"), right)

    def _titled(self, left: str, right: str) -> None:
        for sheet, title in ((self._left, left), (self._right, right)):
            if sheet.border_title != title:
                sheet.border_title = title

    def _refuses(self, state: StationState, action: str) -> bool:
        """Show why the station cannot take a command now, if it cannot."""
        problem = refusal(state, _KEYS[action])
        if problem is not None:
            self.desk.said = (problem,)
        return problem is not None

    def _say(self, code: str) -> None:
        self.desk.said = (Problem(code=code),)
