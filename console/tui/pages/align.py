"""Page Align: verify, clamp, home, find jaw 1, touch off; and jogging, one step per press.

The station moves the machine; this page decides what it shows, and which command it offers when. No key is
silent: what cannot be done now shows why.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.containers import Vertical

from console.session.cut.alignment import AlignStep, force_problems
from console.session.station.commands import (
    Approach,
    Command,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Forget,
    Home,
    TakeJaw,
    TakeTouchOff,
    Verify,
)
from console.session.station.state import Activity, StationState
from console.tui.keymap import PageName
from console.tui.lines import BLANK, Line, Sheet, dim, line, wrapped
from console.tui.page import Page
from console.tui.pages.align_jog import JOGS, JogKeys
from console.tui.pages.align_lines import (
    NEAR_MARK_DEG,
    angle_deg,
    axes_lines,
    drives_are_on,
    in_part_word,
    is_in_part,
    is_over_part,
    is_valid,
    jaw_off_deg,
    step_lines,
    step_now,
    touch_word,
    why_lines,
)
from console.tui.pages.chuck_picture import chuck_lines
from console.tui.pages.jog_lines import JogView, jog_lines
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from console.tui.waiting import waiting
from drivers.lathe.snapshot import AxisName
from profiles.job import Job
from profiles.problem import Problem

CONFIRM_S = 3.0
"""Time in which a second Enter confirms the warning of the first."""

_BY_HAND = {
    AlignStep.CLAMP: "screen.enter_does_it",
    AlignStep.JAW: "screen.jog_does_it",
}


class AlignPage(Page):
    """Page on which tool and part are aligned."""

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

    def __init__(self, desk: UiContext) -> None:
        super().__init__(desk)
        palette = desk.palette
        self._axes = Sheet(palette, id="align-axes")
        self._jog_panel = Sheet(palette, id="align-jog")
        self._steps = Sheet(palette, id="align-steps")
        self._why = Sheet(palette, id="align-why")
        self._chuck = Sheet(palette, id="align-chuck")
        self._jog = JogKeys(desk, self._later)
        self._warned_s: float | None = None
        self._titles()

    def compose(self) -> ComposeResult:
        """Return the panels in two columns."""
        with Vertical(classes="left"):
            yield self._axes
            yield self._jog_panel
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
            self._jog.renew(view.now_s)  # idle time counts from the end of the motion
        self._jog.let_go(state, view.now_s)
        self._jog.press_due()
        self._axes.show(axes_lines(text, state, machine, view.now_s, self._axes.size.width))
        jog = self._jog.view(state, view.now_s)
        self._title_jog(jog)
        self._jog_panel.show(jog_lines(text, jog, self._jog_panel.size.width, self._jog_panel.size.height))
        self._steps.show(step_lines(text, state, job))
        self._why.show(why_lines(text, state, job, machine, self._why.size.width, self._why.size.height))
        self._title_why(state, job)
        if state.seen is not None and self.has_class("-roomy"):
            size = self._chuck.size
            jaws = machine.chuck.jaws if job is None else job.jaws
            past_deg = state.seen.jaw_1_past_mark_deg
            lost = state.activity is Activity.LOST
            self._chuck.show(() if lost else chuck_lines(size.width, size.height, jaws, past_deg))

    def act(self, action: str) -> None:
        """Perform the action of a key, or show why not."""
        if action != "align.take":
            self._warned_s = None
        if action in JOGS:
            self._jog.press(action)
        else:
            self._jog.forget()
            answers: dict[str, Callable[[str], None]] = {
                "align.step": self._do_step,
                "align.take": self._take,
                "align.enable": self._jog.enable,
                "align.larger": self._jog.change_rung,
                "align.smaller": self._jog.change_rung,
                "align.off": self._switch_off,
                "align.back": self._take_back,
            }
            answers[action](action)

    def next_step(self, view: View) -> Line:
        """Return what to do now."""
        text, state, job = self.desk.text, view.state, _job(view)
        word = waiting(state)
        if word:
            return line(dim(text(f"align_page.next.{word}")))
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

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return how to do the present step, and why the alignment is not valid."""
        text, state = self.desk.text, view.state
        by_hand = [] if state.simulated else [BLANK, *wrapped(text("align_page.real"), width)]
        return [*why_lines(text, state, _job(view), self.desk.machine.machine, width), *by_hand]

    def leave(self) -> None:
        """Disable the jog; a step in progress ends with the page."""
        self._warned_s = None
        self._jog.end()
        if self.desk.control.state.activity is Activity.JOGGING:
            self.desk.say_until_key(Problem(code="screen.left_jogging"))
            self.desk.control.stop("page")

    def _next_word(self, state: StationState, step: AlignStep | None, job: Job | None) -> str:
        machine = self.desk.machine.machine
        if step is AlignStep.CLAMP and is_in_part(state, machine):
            return in_part_word(state)
        if step is AlignStep.CLAMP and drives_are_on(state):
            return "clamp_drives_on"
        if step is AlignStep.CLAMP and job is not None and force_problems(job):
            return "clamp_refused"
        if step is AlignStep.JAW and not self._jog.enabled:
            return "jaw_enable"
        if step is AlignStep.TOUCH_OFF:
            place = touch_word(state, machine)
            return (
                f"touch_off{place}_enable" if place == "_over" and not self._jog.enabled else f"touch_off{place}"
            )
        if step is None:
            return "jaw_off" if (jaw_off_deg(state, machine) or 0.0) > NEAR_MARK_DEG else "valid"
        return str(step)

    def _do_step(self, key: str) -> None:
        """Run the present step, where the machine does it (F4)."""
        state, job = self.desk.control.state, self._job
        if self._jog.refuses(state, key):
            return
        match step_now(state.alignment, job):
            case AlignStep.VERIFY:
                self._post(Verify())
            case AlignStep.CLAMP if is_in_part(state, self.desk.machine.machine):
                self._way_out(state)
            case AlignStep.CLAMP if drives_are_on(state):
                self._post(DisableDrives())
            case AlignStep.DRIVES:
                self._post(EnableDrives())
            case AlignStep.HOME:
                self._post(Home())
            case AlignStep.TOUCH_OFF if job is not None:
                self._post(Approach(job=job))
            case None:
                self._say("screen.nothing_to_align" if job is None else "screen.aligned")
            case step:
                self._say(_BY_HAND[step])

    def _take(self, key: str) -> None:
        """Confirm what was done by hand, or take the present position (Enter). Nothing moves."""
        state, job = self.desk.control.state, self._job
        if self._jog.refuses(state, key):
            return
        if job is None:
            self._say("screen.nothing_to_align")
            return
        match step_now(state.alignment, job):
            case AlignStep.CLAMP:
                self._confirm_clamping(state, job)
            case AlignStep.DRIVES if not drives_are_on(state):
                # Another blank: the chuck may have been opened since the drives were disabled after a cut.
                self._confirm_clamping(state, job)
            case AlignStep.JAW:
                self._take_jaw(state)
            case AlignStep.TOUCH_OFF if not is_over_part(state, self.desk.machine.machine):
                self._say("alignment.beside_part", key="tool")
            case AlignStep.TOUCH_OFF:
                self._post(TakeTouchOff(radius_mm=job.radius_mm))
            case None:
                self._say("screen.aligned")
            case _:
                self._say("screen.f4_does_it")

    def _take_jaw(self, state: StationState) -> None:
        """Take jaw 1 at the present position; visibly far from the mark, only after a second press."""
        now_s, warned_s = self.desk.control.now_s(), self._warned_s
        off_deg = 0.0 if state.seen is None else abs(state.seen.jaw_1_past_mark_deg)
        again = warned_s is not None and now_s - warned_s <= CONFIRM_S
        if off_deg > NEAR_MARK_DEG and not again:
            self._warned_s = now_s
            self._say("screen.jaw_far", value=f"{off_deg:.2f}°", limit=f"{CONFIRM_S:.0f} s")
            return
        self._warned_s = None
        self._post(TakeJaw())

    def _take_back(self, key: str) -> None:
        """Forget the touch-off or, before it, jaw 1: that step is the present one again. Nothing moves."""
        state = self.desk.control.state
        if self._jog.refuses(state, key):
            return
        alignment = state.alignment
        later = step_now(alignment, self._job) in (AlignStep.TOUCH_OFF, None)
        if later and (alignment.jaw is not None or alignment.touch_off is not None):
            self._post(Forget())
        else:
            self._say("screen.nothing_to_take_back")

    def _way_out(self, state: StationState) -> None:
        """Return how to retract a tool in the part before the chuck is opened; it needs its drive."""
        if state.snapshot is not None and state.snapshot.loops_closed:
            self._say("machine.tool_in_part")
        else:
            self._post(EnableDrives())

    def _confirm_clamping(self, state: StationState, job: Job) -> None:
        if drives_are_on(state):
            self._say("screen.drives_not_off")
        elif is_in_part(state, self.desk.machine.machine):
            self._say("machine.tool_in_part")
        elif refused := force_problems(job):
            self.desk.said = refused
        else:
            self._post(ConfirmClamping(job=job))

    def _switch_off(self, key: str) -> None:
        state = self.desk.control.state
        if self._jog.stops_what_moves(state, key) or self._jog.refuses(state, key):
            return
        if drives_are_on(state):
            self._post(DisableDrives())
        else:
            self._say("screen.drives_are_off")

    @property
    def _job(self) -> Job | None:
        return None if self.desk.work is None else self.desk.work.job

    def _post(self, intent: Command) -> None:
        self.desk.control.post(intent)

    def _say(self, code: str, *, key: str = "", value: str = "", limit: str = "") -> None:
        self.desk.said = (Problem(code=code, key=key, value=value, limit=limit),)

    def _later(self, after_s: float, call: Callable[[], None]) -> None:
        if self.is_attached:
            self.set_timer(after_s, call)

    def _titles(self) -> None:
        text = self.desk.text
        self._axes.border_title = text("align_page.axes")
        self._steps.border_title = text("align_page.steps")
        self._chuck.border_title = text("align_page.chuck_title")

    def _title_jog(self, jog: JogView) -> None:
        title = self.desk.text("align_page.jog", axes="C °" if jog.axis is AxisName.SPINDLE else "X Z mm")
        if self._jog_panel.border_title != title:
            self._jog_panel.border_title = title

    def _title_why(self, state: StationState, job: Job | None) -> None:
        text = self.desk.text
        if state.activity is Activity.LOST:
            title = text("align_page.unknown_title")
        elif is_valid(state.alignment, job):
            title = text("align_page.valid_title")
        else:
            title = text("align_page.invalid_title")
        if self._why.border_title != title:
            self._why.border_title = title


def _job(view: View) -> Job | None:
    return None if view.work is None else view.work.job
