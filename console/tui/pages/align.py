"""The page Align: verify, clamp, home, find jaw 1, touch off; and jogging, one step at a press.

The station moves the machine; here is what it shows, and what may be asked of it when. No key is silent: what
cannot be done now says why.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.containers import Vertical

from console.session.alignment import AlignStep, force_problems
from console.session.intents import (
    Approach,
    ConfirmClamping,
    Home,
    Intent,
    Jog,
    SwitchOff,
    SwitchOn,
    TakeJaw,
    TakeTouchOff,
    Verify,
)
from console.session.jogging import FIRST_RUNG, IDLE_S, STEPS_MM, longest_in_mm, step_of, tool_radius_mm
from console.session.progress import CutStage
from console.session.state import Activity, StationState
from console.tui.desk import Desk, View
from console.tui.keymap import ACTIONS, PageName
from console.tui.lines import Line, dim, line
from console.tui.page import Page
from console.tui.pages.align_lines import (
    angle_deg,
    axes_lines,
    drives_are_on,
    is_valid,
    step_lines,
    step_now,
    why_lines,
)
from console.tui.pages.chuck_picture import chuck_lines
from console.tui.pages.jog_lines import JogView, jog_lines
from console.tui.sheet import Sheet
from console.tui.theme import Token
from drivers.snapshot import AxisName
from profiles.job import Job
from profiles.problem import Problem

JOGS = {
    "align.in": (AxisName.TOOL, 1.0),
    "align.out": (AxisName.TOOL, -1.0),
    "align.chuck": (AxisName.CARRIAGE, 1.0),
    "align.tail": (AxisName.CARRIAGE, -1.0),
    "align.forward": (AxisName.SPINDLE, 1.0),
    "align.backward": (AxisName.SPINDLE, -1.0),
}
"""Axis and direction of each jog key: toward the work, toward the chuck, with the cut are positive."""

_KEYS = {action.id: action.shown for action in ACTIONS}
_BY_HAND = {
    AlignStep.CLAMP: "screen.enter_does_it",
    AlignStep.JAW: "screen.jog_does_it",
}


class AlignPage(Page):
    """Where tool and part are brought together."""

    name_: ClassVar[PageName] = PageName.ALIGN
    DEFAULT_CSS = """
    AlignPage { layout: horizontal; }
    AlignPage .left { width: 59fr; height: 1fr; }
    AlignPage .right { width: 41fr; height: 1fr; }
    AlignPage Sheet { width: 1fr; height: 1fr; padding: 0 1; border: round $secondary;
        border-title-color: $foreground; background: $background; }
    AlignPage #align-axes { height: 7; }
    AlignPage #align-steps { height: 8; }
    AlignPage #align-chuck { height: 9; display: none; }
    AlignPage.-roomy #align-chuck { display: block; }
    AlignPage.-tall #align-chuck { height: 50%; }
    """

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        palette = desk.palette
        self._axes = Sheet(palette, id="align-axes")
        self._jog = Sheet(palette, id="align-jog")
        self._steps = Sheet(palette, id="align-steps")
        self._why = Sheet(palette, id="align-why")
        self._chuck = Sheet(palette, id="align-chuck")
        self._rung = FIRST_RUNG
        self._enabled_until_s: float | None = None
        self._last_key: str | None = None
        self._titles()

    def compose(self) -> ComposeResult:
        """Return the panels in two columns."""
        with Vertical(classes="left"):
            yield self._axes
            yield self._jog
        with Vertical(classes="right"):
            yield self._steps
            yield self._why
            yield self._chuck

    def show(self, view: View) -> None:
        """Show the newest state."""
        simulated = view.state.simulated and view.state.seen is not None
        self.set_class(simulated and self.size.width >= 100 and self.size.height >= 24, "-roomy")
        self.set_class(self.size.height >= 36, "-tall")
        text, state, job = self.desk.text, view.state, _job(view)
        machine = self.desk.machine.machine
        if state.moving:
            self._renew()  # idle is counted from the end of what moves
        self._let_go_when_idle(view.now_s)
        self._axes.show(axes_lines(text, state, machine, view.now_s, self._axes.size.width))
        jog = self._jog_view(state, job, view.now_s)
        self._jog.show(jog_lines(text, jog, self._jog.size.width, self._jog.size.height))
        self._steps.show(step_lines(text, state.alignment, job))
        self._why.show(why_lines(text, state, job, self._why.size.width, self._why.size.height))
        self._title_why(is_valid(state.alignment, job))
        if state.seen is not None and self.has_class("-roomy"):
            size = self._chuck.size
            jaws = machine.chuck.jaws if job is None else job.jaws
            self._chuck.show(chuck_lines(size.width, size.height, jaws, state.seen.jaw_1_past_mark_deg))

    def act(self, action: str) -> None:
        """Do what a key asks for, or say why not."""
        if action in JOGS:
            self._jog_by(action)
        else:
            answers: dict[str, Callable[[str], None]] = {
                "align.step": self._do_step,
                "align.take": self._take,
                "align.enable": self._enable,
                "align.larger": self._change_rung,
                "align.smaller": self._change_rung,
                "align.off": self._switch_off,
            }
            answers[action](action)

    def next_step(self, view: View) -> Line:
        """Return what to do now."""
        text, state, job = self.desk.text, view.state, _job(view)
        waiting = _waiting(state)
        if waiting:
            return line(dim(text(f"align_page.next.{waiting}")))
        step = step_now(state.alignment, job)
        if job is None and step is None:
            return line((text("align_page.next.no_job"), Token.ACTION))
        words = text(
            f"align_page.next.{self._next_word(state, step, job)}",
            force="" if job is None else f"{job.chucking_force_n:.0f}",
            radius="" if job is None else f"{job.radius_mm:.3f}",
            angle="" if state.snapshot is None else f"{angle_deg(state.snapshot, self.desk.machine.machine):.2f}",
        )
        return line((words, Token.ACTION))

    def leave(self) -> None:
        """Let go of the jog; a step that is under way ends with its page."""
        self._enabled_until_s = self._last_key = None
        if self.desk.control.state.activity is Activity.JOGGING:
            self.desk.control.stop("page")
            self._say("screen.left_jogging")

    def _next_word(self, state: StationState, step: AlignStep | None, job: Job | None) -> str:
        if step is AlignStep.CLAMP and drives_are_on(state):
            return "clamp_drives_on"
        if step is AlignStep.CLAMP and job is not None and force_problems(job):
            return "clamp_refused"
        if step is AlignStep.JAW and self._enabled_until_s is None:
            return "jaw_enable"
        if step is None:
            again = self._taken_again()
            return "valid" if again is None else f"{again}_again"
        return str(step)

    def _do_step(self, key: str) -> None:
        """F4: the present step, where it is the machine's to do."""
        state, job = self.desk.control.state, self._job
        if self._refuses(state, key):
            return
        match step_now(state.alignment, job):
            case AlignStep.VERIFY:
                self._post(Verify())
            case AlignStep.CLAMP if drives_are_on(state):
                self._post(SwitchOff())
            case AlignStep.DRIVES:
                self._post(SwitchOn())
            case AlignStep.HOME:
                self._post(Home())
            case AlignStep.TOUCH_OFF if job is not None:
                self._post(Approach(job=job))
            case None:
                self._say("screen.nothing_to_align" if job is None else "screen.aligned")
            case step:
                self._say(_BY_HAND[step])

    def _take(self, key: str) -> None:
        """Enter: confirm what hands did, or take a place over as it is. Nothing moves."""
        state, job = self.desk.control.state, self._job
        if self._refuses(state, key):
            return
        if job is None:
            self._say("screen.nothing_to_align")
            return
        step = step_now(state.alignment, job) or self._taken_again()
        match step:
            case AlignStep.CLAMP:
                self._confirm_clamping(state, job)
            case AlignStep.DRIVES if not drives_are_on(state):
                # Another blank: whoever switches the drives off after a cut may have opened the chuck.
                self._confirm_clamping(state, job)
            case AlignStep.JAW:
                self._post(TakeJaw())
            case AlignStep.TOUCH_OFF:
                self._post(TakeTouchOff(radius_mm=job.radius_mm))
            case None:
                self._say("screen.aligned")
            case _:
                self._say("screen.f4_does_it")

    def _taken_again(self) -> AlignStep | None:
        """Return what Enter takes once more when all is valid: that of the axis that was jogged last."""
        if self._last_key is None:
            return None
        axis, _ = JOGS[self._last_key]
        return {AxisName.SPINDLE: AlignStep.JAW, AxisName.TOOL: AlignStep.TOUCH_OFF}.get(axis)

    def _confirm_clamping(self, state: StationState, job: Job) -> None:
        if drives_are_on(state):
            self._say("screen.drives_not_off")
        elif _left_inside(state, self._tip_gap_mm(state, job)):
            self._say("machine.tool_in_part")
        elif refused := force_problems(job):
            self.desk.said = refused
        else:
            self._post(ConfirmClamping(job=job))

    def _switch_off(self, key: str) -> None:
        state = self.desk.control.state
        if self._stops_what_moves(state, key) or self._refuses(state, key):
            return
        if drives_are_on(state):
            self._post(SwitchOff())
        else:
            self._say("screen.drives_are_off")

    def _enable(self, key: str) -> None:
        if not self._refuses(self.desk.control.state, key):
            self._enabled_until_s = self.desk.control.now_s() + IDLE_S

    def _change_rung(self, key: str) -> None:
        if self._stops_what_moves(self.desk.control.state, key):
            return
        step = 1 if key == "align.larger" else -1
        self._rung = min(max(self._rung + step, 0), len(STEPS_MM) - 1)
        self._renew()

    def _jog_by(self, key: str) -> None:
        state = self.desk.control.state
        if state.moving and key == self._last_key:
            # The key repeats while it is held: one press is one step.
            self._say("screen.in_motion")
            return
        if self._stops_what_moves(state, key) or self._refuses(state, key):
            return
        self._let_go_when_idle(self.desk.control.now_s())
        if self._enabled_until_s is None:
            self._say("screen.jog_not_enabled")
            return
        axis, sign = JOGS[key]
        step = step_of(axis, self._rung)
        longest = longest_in_mm(self._gap_mm(state, self._job))
        if key == "align.in" and step > longest:
            self._say("screen.step_too_long", value=f"{step:.3f} mm", limit=f"<= {longest:.3f} mm")
            return
        self._last_key = key
        self._renew()
        self._post(Jog(axis=axis, distance=sign * step))

    def _stops_what_moves(self, state: StationState, key: str) -> bool:
        """Another axis, direction or step while something moves is a change of mind: stop first."""
        if not state.moving:
            return False
        self.desk.control.stop("unbound")
        self._say("screen.key_in_motion", key=_KEYS[key])
        return True

    def _refuses(self, state: StationState, key: str) -> bool:
        """Say why the station cannot take an order now, if it cannot."""
        waiting = _waiting(state)
        codes = {
            "stopped": "screen.stopped_first",
            "connecting": "screen.nothing_known",
            "moving": "screen.in_motion",
            "busy": "screen.busy",
        }
        if waiting:
            self._say(codes[waiting], key=_KEYS[key])
        return bool(waiting)

    def _let_go_when_idle(self, now_s: float) -> None:
        if self._enabled_until_s is not None and now_s >= self._enabled_until_s:
            self._enabled_until_s = self._last_key = None

    def _renew(self) -> None:
        if self._enabled_until_s is not None:
            self._enabled_until_s = self.desk.control.now_s() + IDLE_S

    def _jog_view(self, state: StationState, job: Job | None, now_s: float) -> JogView:
        until_s = self._enabled_until_s
        return JogView(
            machine=self.desk.machine.machine,
            rung=self._rung,
            left_s=None if until_s is None else until_s - now_s,
            moving=state.moving,
            gap_mm=self._gap_mm(state, job),
            simulated=state.simulated,
            seen=state.seen,
        )

    def _gap_mm(self, state: StationState, job: Job | None) -> float | None:
        """Return how far the tip is from the part by the touch-off, None before there is one."""
        if job is None or state.alignment.touch_off is None:
            return None
        return self._tip_gap_mm(state, job)

    def _tip_gap_mm(self, state: StationState, job: Job) -> float | None:
        """Return the same by the touch-off or, before it, by the profile; None where the zero is not known."""
        if state.snapshot is None or not state.snapshot.homed:
            return None
        position = state.snapshot.tool.position
        return tool_radius_mm(position, self.desk.machine.machine, state.alignment) - job.radius_mm

    @property
    def _job(self) -> Job | None:
        return None if self.desk.work is None else self.desk.work.job

    def _post(self, intent: Intent) -> None:
        self.desk.control.post(intent)

    def _say(self, code: str, *, key: str = "", value: str = "", limit: str = "") -> None:
        self.desk.said = (Problem(code=code, key=key, value=value, limit=limit),)

    def _titles(self) -> None:
        text = self.desk.text
        self._axes.border_title = text("align_page.axes")
        self._jog.border_title = text("align_page.jog")
        self._steps.border_title = text("align_page.steps")
        self._chuck.border_title = text("align_page.chuck_title")

    def _title_why(self, valid: bool) -> None:
        text = self.desk.text
        title = text("align_page.valid_title") if valid else text("align_page.invalid_title")
        if self._why.border_title != title:
            self._why.border_title = title


def _job(view: View) -> Job | None:
    return None if view.work is None else view.work.job


def _waiting(state: StationState) -> str:
    """Return what has to end before an order can be given: a word of the catalogue, empty when nothing has."""
    if state.stop is not None:
        return "stopped"
    if state.snapshot is None or state.activity in (Activity.CONNECTING, Activity.LOST):
        return "connecting"
    if state.moving:
        return "moving"
    return "" if state.activity is Activity.READY else "busy"


def _left_inside(state: StationState, gap_mm: float | None) -> bool:
    """Whether a cut was left before its end and the tool still stands in the part."""
    left = state.cut is not None and state.cut.stage not in (CutStage.DONE, CutStage.HELD)
    return left and gap_mm is not None and gap_mm < 0.0
