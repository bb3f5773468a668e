"""The page Run: what must hold, arming, the cut as it goes, and how it ended.

Start needs two acts: F5 arms and shows what is about to happen, F6 starts within some seconds. Enter moves
nothing. What cannot be done now says why.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import ClassVar

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical

from console.session.alignment import JawAngle
from console.session.intents import Arm, Disarm, Hold, Retract, Start
from console.session.progress import CutProgress, CutStage
from console.session.state import Activity, StationState
from console.tui.desk import Desk, View
from console.tui.keymap import PageName
from console.tui.lines import BLANK, Line, dim, line, wrapped
from console.tui.page import Page
from console.tui.pages.align_lines import clipped
from console.tui.pages.cut_lines import error_series, live_lines, mean_error_um, progress_line
from console.tui.pages.run_lines import (
    after_lines,
    check_lines,
    checks,
    failing,
    figure_lines,
    may_be_in_part,
    remedy,
    stop_lines,
    summary_lines,
)
from console.tui.plot.polar_view import Mark, PolarTrace, PolarView
from console.tui.plot.trace_view import TraceView
from console.tui.sheet import Sheet
from console.tui.theme import Token
from drivers.cut import Strategy
from profiles.problem import Problem

ENDED = (CutStage.DONE, CutStage.HELD)
FULL_TURN_DEG = (0.0, 360.0)
WIDEST_FACT = 56
"""Columns in which a label and its value still read as one."""

LEAST_POLAR_ROWS = 24
"""Rows of the page from which there is room for the polar picture below the other one."""


class Phase(Enum):
    """What the page is about."""

    BEFORE = auto()
    CUTTING = auto()
    ENDED = auto()
    STOPPED = auto()


def phase_of(state: StationState) -> Phase:
    """Return what the page is about in this state."""
    if state.stop is not None:
        return Phase.STOPPED
    if state.cut is None or state.armed is not None:
        return Phase.BEFORE
    if state.cut.stage in ENDED:
        return Phase.ENDED
    return Phase.CUTTING if state.activity in (Activity.POSITIONING, Activity.CUTTING) else Phase.BEFORE


class RunPage(Page):
    """Where parts are cut."""

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

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        palette = desk.palette
        self._left = Sheet(palette, id="run-left")
        self._right = Sheet(palette, id="run-right")
        self._progress = Sheet(palette, id="run-progress")
        self._values = Sheet(palette, id="run-values")
        self._errors = TraceView(palette=palette, id="run-errors")
        self._polar = PolarView(palette=palette, id="run-polar")
        self._drawn: CutProgress | None = None
        text = desk.text
        self._progress.border_title = text("run_page.cut")
        self._values.border_title = text("run_page.values")
        self._errors.border_title = text("run_page.errors")

    def compose(self) -> ComposeResult:
        """Return two panels of text, and the panels of a cut that take their place."""
        with Horizontal(id="run-two"):
            yield self._left
            yield self._right
        with Vertical(id="run-live"):
            yield self._progress
            with Horizontal(id="run-moment"):
                yield self._values
                with Vertical(id="run-plots"):
                    yield self._errors
                    yield self._polar

    def show(self, view: View) -> None:
        """Show the newest state."""
        phase = phase_of(view.state)
        self.set_class(phase is Phase.CUTTING, "-live")
        self.set_class(self.size.height >= LEAST_POLAR_ROWS, "-roomy")
        cut = view.state.cut
        match phase:
            case Phase.CUTTING if cut is not None:
                self._show_cut(cut, view)
            case Phase.ENDED if cut is not None:
                self._show_end(cut, view.state)
            case Phase.STOPPED:
                self._show_stop(view)
            case _:
                self._show_before(view)

    def act(self, action: str) -> None:
        """Do what a key asks for, or say why not."""
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
        word, token = self._next_word(view)
        armed = view.state.armed
        left_s = 0 if armed is None else max(math.ceil(armed.until_s - view.now_s), 0)
        return line((self.desk.text(f"run_page.next.{word}", left=left_s), token))

    def _next_word(self, view: View) -> tuple[str, Token]:
        state, machine = view.state, self.desk.machine.machine
        phase = phase_of(state)
        if phase is Phase.STOPPED:
            proven = state.stop is not None and state.stop.rest_s is not None
            return "stopped" if proven else "stopping", Token.ACTION
        if phase is Phase.CUTTING and state.cut is not None:
            if state.cut.stage is CutStage.POSITION:
                return "positioning", Token.STRONG
            return ("holding" if state.cut.holding else "cutting"), Token.STRONG
        if state.armed is not None:
            return "armed", Token.ACTION
        if state.activity is not Activity.READY:
            return "wait", Token.DIM
        if phase is Phase.ENDED and state.cut_done:
            return ("measure" if state.simulated else "take_out"), Token.ACTION
        if _left_inside(state) and view.work is not None and may_be_in_part(state, view.work.job, machine):
            closed = state.snapshot is not None and state.snapshot.loops_closed
            return ("retract" if closed else "switch_on"), Token.ACTION
        if view.work is None:
            return "no_job", Token.ACTION
        failed = [check.name for check in checks(state, view.work, machine) if check.problems]
        if not failed:
            return "arm", Token.ACTION
        return ("set_up" if failed[0] == "job" else "align"), Token.ACTION

    def _arm(self) -> None:
        state, work = self.desk.control.state, self.desk.work
        if state.armed is not None:
            self.desk.control.post(Disarm())
            return
        reasons = failing(checks(state, work, self.desk.machine.machine))
        if reasons:
            self.desk.said = reasons
        elif state.activity is not Activity.READY:
            self._say("screen.busy")
        elif work is not None:
            # The record must not name a file as the source of a job that differs from it.
            sha256 = f"{work.loaded.sha256} edited" if work.edited else work.loaded.sha256
            self.desk.control.post(Arm(job=work.job, job_sha256=sha256, strategy=Strategy(work.strategy)))

    def _start(self) -> None:
        state = self.desk.control.state
        if state.armed is None or self.desk.control.now_s() > state.armed.until_s:
            self._say("screen.not_armed")
        elif state.activity is not Activity.READY or state.moving:
            self._say("screen.busy")
        else:
            self.desk.control.post(Start())

    def _hold(self) -> None:
        state = self.desk.control.state
        if state.activity is not Activity.CUTTING or state.cut is None:
            self._say("screen.nothing_to_hold")
        elif state.cut.holding:
            self._say("screen.holding_already")
        else:
            self.desk.control.post(Hold())

    def _retract(self) -> None:
        state, work = self.desk.control.state, self.desk.work
        job = None if work is None else work.job
        if state.stop is not None:
            self._say("screen.stopped_first", key="F8")
        elif state.snapshot is None:
            self._say("screen.nothing_known")
        elif state.moving:
            self._say("screen.in_motion")
        elif state.activity is not Activity.READY:
            self._say("screen.busy")
        elif not may_be_in_part(state, job, self.desk.machine.machine):
            self._say("screen.tool_is_out")
        elif not state.snapshot.loops_closed:
            self._say("machine.retract_not_possible")
        else:
            self.desk.control.post(Retract())

    def _show_before(self, view: View) -> None:
        text, state, work = self.desk.text, view.state, view.work
        size = self._left.size
        found = checks(state, work, self.desk.machine.machine)
        self._left.show(check_lines(text, found, size.width, size.height))
        width = self._right.size.width
        if work is None:
            self._right.show(wrapped(text("run_page.no_job"), width))
        else:
            rows = summary_lines(text, state, work, view.now_s, min(width, WIDEST_FACT))
            self._right.show(clipped(rows, self._right.size.height))
        ready = text("run_page.armed_title") if state.armed is not None else text("run_page.summary")
        self._titled(text("run_page.checks"), ready)

    def _show_cut(self, cut: CutProgress, view: View) -> None:
        text = self.desk.text
        job = None if view.work is None else view.work.job
        self._progress.show([progress_line(text, cut, self._progress.size.width)])
        self._values.show(live_lines(text, cut, job, min(self._values.size.width, WIDEST_FACT)))
        if cut is self._drawn:
            return
        self._drawn = cut
        series, limits = error_series(cut)
        self._errors.show(series, FULL_TURN_DEG, limits, "um")
        if self.has_class("-roomy"):
            self._show_polar(cut, view.state.alignment.jaw)

    def _show_polar(self, cut: CutProgress, jaw: JawAngle | None) -> None:
        angles_deg, errors_um = mean_error_um(cut)
        # A tool that stands too far in leaves too small a radius.
        trace = PolarTrace(angle_deg=angles_deg, deviation_um=-errors_um, token=Token.AFTER)
        self._polar.show([trace], marks=[] if jaw is None else [Mark(angle_deg=jaw.angle_deg, label="1")])
        title = self.desk.text("run_page.polar", scale=f"{self._polar.scale_um_per_division:g}")
        if self._polar.border_title != title:
            self._polar.border_title = title

    def _show_end(self, cut: CutProgress, state: StationState) -> None:
        text = self.desk.text
        self._left.show(figure_lines(text, cut, min(self._left.size.width, WIDEST_FACT)))
        self._right.show(after_lines(text, state, self._right.size.width))
        self._titled(text("run_page.figures"), text("run_page.what_next"))

    def _show_stop(self, view: View) -> None:
        text, stop = self.desk.text, view.state.stop
        if stop is None:
            return
        width = min(self._left.size.width, WIDEST_FACT)
        what = wrapped(remedy(text, stop), width, Token.STRONG)
        self._left.show([*stop_lines(text, stop, width), BLANK, *what])
        width = min(self._right.size.width, WIDEST_FACT)
        cut, job = view.state.cut, None if view.work is None else view.work.job
        if cut is None or cut.stage in ENDED:
            self._right.show([line(dim(text("run_page.no_cut")))])
        else:
            self._right.show(live_lines(text, cut, job, width))
        self._titled(text("run_page.stopped"), text("run_page.last_values"))

    def _titled(self, left: str, right: str) -> None:
        for sheet, title in ((self._left, left), (self._right, right)):
            if sheet.border_title != title:
                sheet.border_title = title

    def _say(self, code: str, *, key: str = "") -> None:
        self.desk.said = (Problem(code=code, key=key),)


def _left_inside(state: StationState) -> bool:
    """Whether a cut was left before its end, so that the tool may stand in the part."""
    return state.cut is not None and state.cut.stage not in ENDED
