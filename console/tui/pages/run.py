"""Page Run: start conditions, arming (F5), start (F6), progress and end of a cut. Enter moves nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import ClassVar

from rich.cells import cell_len

from console.session.cut.compensated_cut import with_news
from console.session.cut.telemetry import stretches_event
from console.session.guide.refusals import find_refusals
from console.session.guide.rows import RUN, row_of
from console.session.guide.situation import GuidePhase, Situation, phase_of
from console.session.guide.start_checks import checks
from console.session.station import commands
from console.session.station.jogging import clears_tables
from console.session.station.state import Activity
from console.session.work import Work, changed_since_opened
from console.text.along_length import stretch_words
from console.text.catalogue import Catalogue
from console.tui.align.hold_run import JogPresses, ReportedStrokes
from console.tui.application.key_releases import Stroke
from console.tui.keymap import Action, PageName, actions_of
from console.tui.lines import BLANK, Line, dim, hanging, line, wrap_line
from console.tui.page import Page
from console.tui.pages import run_lines
from console.tui.pages.cut_lines import live_lines
from console.tui.pages.fields import name_field
from console.tui.pages.stop_lines import lost_lines, stop_lines
from console.tui.run.adjust_lines import adjust_in_full, adjust_reasons, armed_bounds, list_adjustables
from console.tui.run.error_band import error_band
from console.tui.run.moment_lines import moment_in_full
from console.tui.run.panels import WIDEST_FACT, RunPanels
from console.tui.theme import Token
from console.tui.ui_context import KEYS, UiContext, View
from drivers.cutting.bounds import Adjustable
from drivers.cutting.strategy import Strategy
from profiles.problem import Problem

_ADJUSTS = {"run.more": 1, "run.less": -1}  # steps by a press
LEAST_POLAR_ROWS = 24  # rows of the page from which there is room for the polar plot below the other one
CELLS_A_SECOND = 12.0
"""Reading slowly, as figures are compared: 140 English words, or 330 Korean syllables, a minute."""

FIND_S = 5.0  # to look from the key to the summary, and back to the key


def reading_s(rows: Sequence[Line]) -> float:
    """Return how long these rows take to read, s, between the bounds of an arming."""
    cells = sum(cell_len("".join(piece.split())) for row in rows for piece, _ in row)
    return min(max(FIND_S + cells / CELLS_A_SECOND, commands.LEAST_ARMED_S), commands.MOST_ARMED_S)


def why_lines(
    text: Catalogue, actions: tuple[Action, ...], why_not: Callable[[str], tuple[Problem, ...]], width: int
) -> list[Line]:
    """Return each action that is refused now with its reasons; nothing where none is."""
    rows = [row for action in actions for row in _of_action(text, action, why_not(action.id), width)]
    return [BLANK, line((text("run_page.why_not"), Token.TITLE)), *rows] if rows else []


def _of_action(text: Catalogue, action: Action, reasons: tuple[Problem, ...], width: int) -> Iterator[Line]:
    if not reasons:
        return
    yield line((f"✗ {action.shown} {text(f'key.{action.id}')}", Token.WARNING))
    for problem in dict.fromkeys(reasons):
        yield from hanging(dim("  "), text.problem(name_field(problem, text)), width)


class AdjustKeys:
    """Which presses of + and - are steps. Times are of any monotonic clock."""

    def __init__(self) -> None:
        self._presses, self._strokes = JogPresses(), ReportedStrokes()
        self.held = False

    def forget(self) -> None:
        """Drop a press that waits for its decision: another key was pressed, or the cut is over."""
        self._presses.forget()
        self.held = False

    def press(self, action: str, stroke: Stroke | None, now_s: float) -> list[str]:
        """Note a press; return the actions that are known by now to be steps, in the order of their presses."""
        before = self.take_due_actions(now_s)
        if stroke is not None:
            self._presses.forget()
            finger = self._strokes.is_finger(stroke, now_s)
            self.held = not finger
        else:
            finger = self._presses.press(action, now_s)
            self.held = self._presses.held
        return [*before, action] if finger else before

    def take_due_actions(self, now_s: float) -> list[str]:
        """Return the action of a press that no repeat followed, once."""
        action = self._presses.take_due_key(now_s)
        return [] if action is None else [action]


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
    RunPage #run-program { height: 7; }
    RunPage.-paused #run-program { height: 1fr; }
    RunPage.-paused #run-errors { display: none; }
    RunPage #run-values { width: 47fr; }
    RunPage #run-plots { width: 53fr; height: 1fr; }
    RunPage PolarView { display: none; }
    RunPage.-roomy PolarView { display: block; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._shown = RunPanels(ui)
        self.panels = self._shown.widgets
        self._view: View | None = None
        self._waits_for_room = False
        self._asked = False
        self._adjusts, self._adjust_keys = Adjustable.OVERRIDE, AdjustKeys()

    def show(self, view: View) -> None:
        """Show the newest state."""
        self._view = view
        self._take_news()
        phase = phase_of(view.state)
        self._adjust(self._adjust_keys.take_due_actions(self.ui.control.now_s()))
        self.set_class(phase is GuidePhase.CUTTING, "-live")
        self.set_class(view.state.paused, "-paused")
        roomy = self.size.height >= LEAST_POLAR_ROWS
        if roomy != self.has_class("-roomy"):
            self._shown.redraw()  # a hidden plot has missed what was drawn
        self.set_class(roomy, "-roomy")
        if self._have_room(phase):
            self._shown.fill(phase, view, self._adjusts, roomy=roomy)

    def leave(self) -> None:
        """Mark the versions for a new check: others may learn meanwhile."""
        self._asked = False
        self._adjust_keys.forget()

    def note_action(self, action: str | None) -> None:
        """Drop a press that waits, at any key but those that change the cut."""
        if action not in _ADJUSTS:
            self._adjust_keys.forget()

    def _take_news(self) -> None:
        """Check once, when the page is shown again, whether a newer version was accepted meanwhile."""
        work, state = self.ui.work, self.ui.control.state
        if not self._asked and work is not None:
            self._asked = True
            self.ui.work = with_news(work, self.ui.data, simulated=state.simulated, lathe=state.lathe)

    def _have_room(self, phase: GuidePhase) -> bool:
        """Whether the panels know their size. If not, they are filled as soon as they have a layout."""
        if self._shown.have_room(phase):
            return True
        if self.is_attached and not self._waits_for_room:
            self._waits_for_room = True
            self.call_after_refresh(self._show_in_room)
        return False

    def _show_in_room(self) -> None:
        if self._view is not None:
            self.show(self._view)
        self._waits_for_room = False

    def act(self, action: str) -> None:
        """Perform the action of a key, or show why not."""
        if action == "run.arm":
            self._arm()
        elif action in _ADJUSTS:
            self._press_adjust(action)
        elif action == "run.choose" and not self.ui.answers(self.why_not(action, self.ui.view)):
            self._choose()
        command = self._command(action)
        if command is not None and not self.ui.answers(self.why_not(action, self.ui.view)):
            self.ui.control.post(command)

    def _command(self, action: str) -> commands.Command | None:
        """Return the command of a key, if it has one; F6 starts what is armed, or resumes what is held."""
        match action:
            case "run.start":
                return commands.ResumeFeed() if self.ui.control.state.paused else commands.Start()
            case "run.feed_hold":
                return commands.HoldFeed()
            case "run.one_turn":
                return commands.ResumeFeed(one_turn=True)
            case "run.hold":
                return commands.EndCut()
            case "run.retract":
                state = self.ui.control.state
                return (
                    commands.ClearTables()
                    if clears_tables(state.snapshot, state.alignment)
                    else commands.Retract()
                )
            case _:
                return None

    def _press_adjust(self, action: str) -> None:
        """Take a press of a key that changes the cut; that it is no repeat may be known a moment later only."""
        self._adjust(self._adjust_keys.press(action, self.ui.stroke, self.ui.control.now_s()))
        if self._adjust_keys.held:
            self.ui.say("screen.key_repeats")

    def _adjust(self, actions: list[str]) -> None:
        """Command the steps of some presses, unless something is against them: then none that waits is made."""
        for action in actions:
            if self.ui.answers(self.why_not(action, self.ui.view)):
                self._adjust_keys.forget()
            else:
                self.ui.control.post(self._adjustment(action))

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why nothing can be armed, started, ended or retracted now."""
        if action in (*_ADJUSTS, "run.choose"):
            return adjust_reasons(action, self._adjustment(action), view.state)
        return find_refusals(action, self._present_situation(view), KEYS[action])

    def _present_situation(self, view: View) -> Situation:
        machine = self.ui.machine.machine
        return Situation(state=view.state, work=view.work, machine=machine, now_s=view.now_s)

    def _adjustment(self, action: str) -> commands.Adjust:
        return commands.Adjust(what=self._adjusts, steps=_ADJUSTS.get(action, 0))

    def _choose(self) -> None:
        """Let + and - change the next one of what this cut allows."""
        cut = self.ui.control.state.cut
        choices = [] if cut is None else list_adjustables(cut.adjusted.bounds)
        place = choices.index(self._adjusts) + 1 if self._adjusts in choices else 0
        self._adjusts = choices[place % len(choices)]
        self._shown.redraw()

    def next_step(self, view: View) -> Line:
        """Return what to do now."""
        if view.state.activity is Activity.LOST:
            return BLANK  # `lost_step`, the same on every page
        row = row_of(RUN, self._present_situation(view))
        under_way = phase_of(view.state) is GuidePhase.CUTTING or row.word == "run.taken_out"
        waits = row.word in ("run.loading", "run.moves", "run.wait")
        token = Token.STRONG if under_way else Token.DIM if waits else Token.ACTION
        armed, until_s = view.state.armed, view.state.loading_until_s
        if armed is not None:
            until_s = armed.until_s
        left_s = 0 if until_s is None else max(math.ceil(until_s - view.now_s), 0)
        return line((self.ui.text(row.sentence, left=left_s), token))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return what was armed, what is missing, or what to do next; and every reason against an action."""
        why = why_lines(self.ui.text, actions_of(self.name_), lambda action: self.why_not(action, view), width)
        return [*self._told_in_full(view, width), *why]

    def _told_in_full(self, view: View, width: int) -> list[Line]:
        text, state, machine = self.ui.text, view.state, self.ui.machine.machine
        facts = min(width, WIDEST_FACT)
        match phase_of(state):
            case GuidePhase.LOST:
                return lost_lines(text, state, view.now_s, width)
            case GuidePhase.STOPPED if state.stop is not None:
                return stop_lines(text, state, facts)
            case GuidePhase.ENDED:
                return run_lines.after_lines(text, state, view.work, machine, width)
            case GuidePhase.CUTTING if state.cut is not None:
                live = live_lines(text, state.cut, view.job, facts)
                changed = adjust_in_full(text, state.cut, self._adjusts, width)
                along = wrap_line(stretch_words(stretches_event(state.cut.stretches), text, "brief"), width)
                moment = [*moment_in_full(text, state.cut, error_band(state.cut), width), *along]
                return [*moment, *changed, BLANK, *live]
        moves = [] if state.armed is None else run_lines.moves_lines(text, state.armed, machine, width)
        rows = [] if view.work is None else run_lines.summary_lines(text, state, view.work, view.now_s, facts)
        found = run_lines.check_lines(text, checks(state, view.work, machine), width)
        if state.armed is not None:
            moves += wrap_line(text("run_page.adjust.armed", bounds=armed_bounds(text, state.armed.bounds)), width)
        return [*moves, *found, *run_lines.input_lines(text, state.snapshot, width), *rows]

    def _arm(self) -> None:
        state, work = self.ui.control.state, self.ui.work
        if state.armed is not None:
            self.ui.control.post(commands.Disarm())
            return
        problems = self.why_not("run.arm", self.ui.view) or changed_since_opened(work)
        if not self.ui.answers(problems) and work is not None:
            # The record must not name a file as the source of a job that differs from it.
            sha256 = f"{work.loaded.sha256} edited" if work.edited else work.loaded.sha256
            command = commands.Arm(
                job=work.job,
                job_sha256=sha256,
                strategy=Strategy(work.strategy),
                loaded=None if work.edited else work.loaded,
                compensation=work.compensation,
                stage=work.stage,
                valid_s=self._reading_s(work),
                inverts=work.inverts,
            )
            self.ui.control.post(command)

    def _reading_s(self, work: Work) -> float:
        """Return how long the summary takes to read that arming will show."""
        view = self.ui.view
        summary = run_lines.summary_lines(self.ui.text, view.state, work, view.now_s, WIDEST_FACT)
        moves = wrap_line(self.ui.text("run_page.moves_first", z=0, radius=0, speed=0, duration=0), WIDEST_FACT)
        return reading_s([*summary, *moves])
