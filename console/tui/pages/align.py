"""Page Align: verify, clamp, home, find jaw 1, touch off; jogging. What cannot be done now shows why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import zip_longest
from typing import ClassVar

from textual.containers import Vertical

from console.session.cut.alignment import AlignStep, step_now
from console.session.cut.jaw_by_indicator import allowed_spread_deg, between_deg
from console.session.guide.refusals import find_refusals
from console.session.guide.rows import ALIGN, row_of
from console.session.guide.situation import NEAR_MARK_DEG, Situation, angle_deg
from console.session.guide.waiting import waiting
from console.session.station import commands
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.align import align_lines
from console.tui.align.align_jog import JOGS, JogKeys, hold_the_key
from console.tui.align.answers import asked_lines
from console.tui.align.ask_keys import AlignEntry, AskKeys
from console.tui.application.far_terminal import WITHIN_S
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import BLANK, NOTHING, Line, Sheet, dim, line, width_of
from console.tui.page import Page
from console.tui.pages.jog_lines import chuck_lines, jog_lines, jog_panel, jog_title
from console.tui.theme import Token
from console.tui.ui_context import KEYS, UiContext, View
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

ROOMY_ROWS = 24  # rows of the page from which the chuck has a panel of its own
CONFIRM_S = 3.0  # time in which a second Enter confirms the warning of the first
PICTURE_COLUMNS, BESIDE_COLUMNS, PICTURE_ROWS, LEAST_ROWS = 14, 14, 5, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class JawSeen:
    """Jaw 1 past the mark, degrees in the direction of the cut; `simulated` where it is seen, not computed.

    `angle_deg` is the spindle's, None before its index is known. `about`: it is judged by eye.
    """

    past_deg: float
    angle_deg: float | None
    simulated: bool
    about: bool = False

    @property
    def angle(self) -> str:
        """The angle of the spindle as it is shown."""
        return f"C {NOTHING}" if self.angle_deg is None else f"C {self.angle_deg:.2f}°"


def jaw_seen(state: StationState, machine: MachineProfile) -> JawSeen | None:
    """Return where jaw 1 is now; None if that is not known."""
    snapshot, jaw = state.snapshot, state.alignment.jaw
    if state.activity is Activity.LOST or snapshot is None:
        return None
    angle_deg = 360.0 * (snapshot.spindle.position / machine.spindle.counts_per_rev % 1.0)
    if state.simulated:
        past = None if state.seen is None else state.seen.jaw_1_past_mark_deg
    else:
        past = None if jaw is None or not snapshot.homed else between_deg(jaw.angle_deg, angle_deg)
    if past is None:
        return None
    about = state.seen is not None and state.seen.dials is not None
    known = "home_complete" in snapshot.spindle.flags
    return JawSeen(past_deg=past, angle_deg=angle_deg if known else None, simulated=state.simulated, about=about)


def picture_lines(text: Catalogue, seen: JawSeen | None, jaws: int, rows: int, width: int) -> list[Line]:
    """Return the chuck beside its figures, nothing where there is no room for it."""
    if seen is None or rows < LEAST_ROWS or width < PICTURE_COLUMNS + BESIDE_COLUMNS:
        return []
    drawn = chuck_lines(PICTURE_COLUMNS, min(rows, PICTURE_ROWS), jaws, seen.past_deg)
    beside: list[Line] = [
        line(seen.angle),
        line(
            text("align_page.jaw_at", angle=f"≈{seen.past_deg:+.0f}°" if seen.about else f"{seen.past_deg:+.2f}°")
        ),
        line(("◂ ", Token.MARK), dim(text("align_page.mark"))),
        line(("SIM", Token.SIM)) if seen.simulated else BLANK,
    ]
    pairs = zip_longest(drawn, beside[: len(drawn)], fillvalue=BLANK)
    return [(*ring, dim(" " * (PICTURE_COLUMNS + 1 - width_of(ring))), *words) for ring, words in pairs]


class AlignPage(Page):
    """Page on which tool and part are aligned."""

    name_: ClassVar[PageName] = PageName.ALIGN
    DEFAULT_CSS = """
    AlignPage { layout: horizontal; layers: base entry; }
    AlignPage .left { width: 59fr; height: 1fr; }
    AlignPage .right { width: 41fr; height: 1fr; }
    AlignPage Sheet { width: 1fr; height: 1fr; padding: 0 1; border: round $secondary;
        border-title-color: $foreground; background: $background; }
    AlignPage #align-axes { height: 7; }
    AlignPage #align-large { height: 19; display: none; }
    AlignPage.-tall.-wide #align-large { display: block; }
    AlignPage #align-asked { display: none; height: 1fr; }
    AlignPage.-asking #align-asked { display: block; }
    AlignPage.-asking #align-jog { display: none; }
    AlignPage #align-entry { offset: 14 8; }
    AlignPage #align-steps { height: 8; }
    AlignPage.-low #align-steps { height: 5; }
    AlignPage #align-chuck { height: 9; display: none; }
    AlignPage.-roomy #align-chuck { display: block; }
    AlignPage.-tall #align-chuck { height: 50%; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        palette = ui.palette
        self._axes = Sheet(palette, id="align-axes")
        self._jog_panel = Sheet(palette, id="align-jog")
        self._steps = Sheet(palette, id="align-steps")
        self._why = Sheet(palette, id="align-why")
        self._chuck = Sheet(palette, id="align-chuck")
        self._large = Sheet(palette, id="align-large")
        self._asked, self._entry = Sheet(palette, id="align-asked"), AlignEntry()
        self.panels = (
            Vertical(self._axes, self._jog_panel, self._asked, self._large, classes="left"),
            Vertical(self._steps, self._why, self._chuck, classes="right"),
            self._entry,
        )
        self._jog = JogKeys(ui, self._schedule_call)
        self._ask = AskKeys(ui, self._entry, self._jog)
        self._warned_s: float | None = None
        self._axes.border_title = ui.text("align_page.axes")
        self._steps.border_title = ui.text("align_page.steps")
        self._chuck.border_title = ui.text("align_page.chuck_title")

    def show(self, view: View) -> None:
        """Show the newest state."""
        seen = jaw_seen(view.state, self.ui.machine.machine)
        self.set_class(seen is not None and self.size.width >= 100 and self.size.height >= ROOMY_ROWS, "-roomy")
        self.set_class(self.size.height < ROOMY_ROWS, "-low")
        text, state, job = self.ui.text, view.state, view.job
        machine = self.ui.machine.machine
        if state.moving:
            self._jog.renew(view.now_s)  # idle time counts from the end of the motion
        self._jog.let_go(state, view.now_s)
        self._jog.follow()
        self._axes.show(align_lines.axes_lines(text, state, machine, view.now_s, self._axes.size.width))
        if self.has_class("-tall") and self.has_class("-wide"):
            rows = align_lines.large_lines(text, state, machine, view.now_s, self._large.size.width)
            self._large.show(rows, text("align_page.large"))
        jog = self._jog.view(state, view.now_s)
        rows, more = jog_panel(text, jog, *self._jog_panel.size)
        self._jog_panel.show(rows, jog_title(text, jog), more)
        self._show_asked(view)
        jaws = machine.chuck.jaws if job is None else job.jaws
        steps, roomy = align_lines.step_lines(text, state, job), self.has_class("-roomy")
        low = self.has_class("-low")
        self._steps.show(align_lines.beside_each_other(steps, self._steps.size) if low else steps)
        self._show_why(view, None if roomy else seen, jaws)
        if roomy and seen is not None:
            title = text("align_page.chuck_title" if state.simulated else "align_page.chuck_found")
            drawn = chuck_lines(*self._chuck.size, jaws, seen.past_deg)
            self._chuck.show(drawn, title, seen.angle)

    def act(self, action: str) -> None:
        """Perform the action of a key, or show why not."""
        if action != "align.take":
            self._warned_s = None
        if self._ask.is_open:  # which first gets the characters that came before
            self._entry.call_later(self._do, action)
        else:
            self._do(action)

    def _do(self, action: str) -> None:
        if self.ui.answers(self._ask.why_not(action, self.ui.view)):
            return
        if action in JOGS:
            self._jog.press(action)
        else:
            self._jog.drop_waiting_steps(action)
            answers: dict[str, Callable[[str], None]] = {
                "align.step": self._do_step,
                "align.take": self._take,
                "align.enable": self._jog.enable,
                "align.larger": self._jog.change_rung,
                "align.smaller": self._jog.change_rung,
                "align.off": self._switch_off,
                "align.back": self._take_back,
                "align.goto": self._ask_number,
                "align.go": lambda _: self._ask.go(self.ui.view),
                "align.force": self._ask_number,
                "align.skim": self._ask_number,
                "align.flank": self._take_flank,
                "align.clamping": self._ask_number,
                "align.hold": lambda _: self._jog.calibrate(),
            }
            answers[action](action)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why the machine, the step or the jog is not ready for a key."""
        if action == "align.go" or self._ask.is_open:
            reasons = self._ask.why_not(action, view)
            if reasons or action == "align.go":
                return reasons
        if action in JOGS:
            return self._jog.why_not(action, view.state, view.now_s)
        if action == "align.hold":
            return (hold_the_key(),)
        if action in ("align.larger", "align.smaller"):
            return ()
        return find_refusals(action, self._present_situation(view), KEYS[action])

    def _present_situation(self, view: View) -> Situation:
        return Situation(state=view.state, work=view.work, machine=self.ui.machine.machine, now_s=view.now_s)

    @property
    def field(self) -> FieldKind:
        """A number, while one is asked for."""
        return FieldKind.NUMBER if self._ask.is_open else FieldKind.NONE

    def next_step(self, view: View) -> Line:
        """Return what to do now."""
        text, state, job = self.ui.text, view.state, view.job
        if self._ask.is_open:
            return line((text(f"align_page.next.asked_{self._ask.entry_kind}"), Token.ACTION))
        row = row_of(ALIGN, self._present_situation(view))
        facts = {"force": "", "radius": "", "angle": ""}
        if job is not None:
            facts |= {"force": f"{job.chucking_force_n:.0f}", "radius": text.units.figure(job.radius_mm, "mm", 3)}
        if state.snapshot is not None:
            facts["angle"] = f"{angle_deg(state.snapshot, self.ui.machine.machine):.2f}"
        return line((text(row.sentence, **facts), Token.DIM if waiting(state) else Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return how to do the present step, why the alignment is not valid, and all of the jog panel."""
        text, state = self.ui.text, view.state
        if self._ask.is_open:
            return asked_lines(text, self._ask.question(view), width, None)
        why = self._why_lines(view, width, None)
        return [*why, BLANK, *jog_lines(text, self._jog.view(state, view.now_s), width, None)]

    def note_action(self, action: str | None) -> None:
        """Drop the steps of a jog key that wait, at any other key."""
        self._jog.drop_waiting_steps(action)

    def leave(self) -> None:
        """Disable the jog; a step in progress ends with the page."""
        self._warned_s = None
        self._stop_jog("page", "screen.left_jogging")
        self._jog.end()
        self._ask.close()

    def on_mount(self) -> None:
        """Watch the focus of the terminal, where it reports it: whoever looks elsewhere does not jog."""
        self.watch(self.app, "app_focus", self._see_focus, init=False)

    def _see_focus(self, focused: bool) -> None:
        if not focused:
            self._stop_jog("blur", "screen.blurred_jogging")
            self._jog.end()

    def _stop_jog(self, reason: str, code: str) -> None:
        if self.ui.control.state.activity is Activity.JOGGING or self.ui.queued:
            self.ui.say_until_key(Problem(code=code))
            self.ui.stop(reason)

    def _do_step(self, key: str) -> None:
        """Run the present step, where the machine does it (F4)."""
        job, now = self.ui.job, self._present_situation(self.ui.view)
        if self.ui.answers(self.why_not(key, self.ui.view)):
            return
        match now.step:
            case AlignStep.VERIFY:
                self.ui.control.post(commands.Verify())
            case AlignStep.CLAMP if now.must_come_out:
                # The tool must be retracted before the chuck is opened; that needs its drive.
                self._enable_drives(key)
            case AlignStep.CLAMP if now.homes_first:
                self.ui.control.post(commands.Home())
            case AlignStep.CLAMP if now.drives_on:
                self.ui.control.post(commands.DisableDrives())
            case AlignStep.CLAMP | AlignStep.DRIVES:
                self._enable_drives(key)
            case AlignStep.HOME:
                self.ui.control.post(commands.Home())
            case AlignStep.TOUCH_OFF if job is not None:
                self.ui.control.post(commands.Approach(job=job))

    def _enable_drives(self, key: str) -> None:
        """Enable the drives; from a terminal that is not at the machine only by who says once that he sees it."""
        control, far = self.ui.control, self.ui.terminal
        if far.asks(control.now_s(), simulated=control.state.simulated):
            self.ui.say("screen.see_machine", key=KEYS[key], value=far.client, limit=f"{WITHIN_S:.0f} s")
        else:
            control.post(commands.EnableDrives())

    def _take(self, key: str) -> None:
        """Confirm what was done by hand, or take the present position (Enter). Nothing moves."""
        state, job = self.ui.control.state, self.ui.job
        if self._ask.is_open:
            self._ask.take(self.ui.view)
            return
        if self.ui.answers(self.why_not(key, self.ui.view)) or job is None:
            return
        match step_now(state.alignment, job):
            case AlignStep.CLAMP | AlignStep.DRIVES:
                self.ui.control.post(commands.ConfirmClamping(job=job))
            case AlignStep.JAW:
                self._take_jaw(state, job)
            case AlignStep.TOUCH_OFF:
                self.ui.control.post(commands.TakeTouchOff(radius_mm=job.radius_mm))

    def _take_jaw(self, state: StationState, job: Job) -> None:
        """Take jaw 1 by its flanks, or where it is; visibly far from the mark, only after a second press."""
        if state.alignment.flanks:
            self.ui.control.post(commands.TakeJaw(most_spread_deg=allowed_spread_deg(job)))
            return
        now_s, warned_s = self.ui.control.now_s(), self._warned_s
        shown = state.seen is not None and state.seen.dials is None
        off_deg = 0.0 if state.seen is None or not shown else abs(state.seen.jaw_1_past_mark_deg)
        again = warned_s is not None and now_s - warned_s <= CONFIRM_S
        if off_deg > NEAR_MARK_DEG and not again:
            self._warned_s = now_s
            self.ui.say("screen.jaw_far", value=f"{off_deg:.2f}°", limit=f"{CONFIRM_S:.0f} s")
            return
        self._warned_s = None
        self.ui.control.post(commands.TakeJaw())

    def _take_back(self, key: str) -> None:
        """Forget a typed reading, the touch-off or, before it, jaw 1, whose step is the present one again."""
        if self._ask.drop():
            return
        if not self.ui.answers(self.why_not(key, self.ui.view)):
            self.ui.control.post(commands.Forget())

    def _show_why(self, view: View, seen: JawSeen | None, jaws: int) -> None:
        """Show what to do and what is missing, with the chuck where there is room; for jaw 1 before the rest."""
        text, now, (width, height) = self.ui.text, self._present_situation(view), self._why.size
        rows = self._why_lines(view, width, None)
        first = now.step is AlignStep.JAW
        room = PICTURE_ROWS if first and height > 2 * PICTURE_ROWS else height - len(rows)
        picture = picture_lines(text, seen, jaws, room, width)
        shown, left = rows, height - len(picture)
        if len(rows) > left:
            shown = self._why_lines(view, width, left)
        self._why.show([*picture, *shown], self._why_title(view.state, view.job))

    def _why_lines(self, view: View, width: int, height: int | None) -> list[Line]:
        now = self._present_situation(view)
        return align_lines.why_lines(
            self.ui.text, now, width, height, reads_itself=self._ask.indicator is not None
        )

    def _ask_number(self, key: str) -> None:
        """Ask for a number: a target (g), a force (f), the skim diameter (m), indicator readings (n)."""
        if self._ask.is_open or not self.ui.answers(self.why_not(key, self.ui.view)):
            self._ask.ask(key, self.ui.view)

    def _take_flank(self, key: str) -> None:
        """Take a flank of jaw 1 at the indicator (i), or its reading into the entry. Nothing moves."""
        if self._ask.asks_readings:
            self._ask.ask(key, self.ui.view)
        elif not self.ui.answers(self.why_not(key, self.ui.view)):
            self.ui.control.post(commands.TakeFlank())

    def _show_asked(self, view: View) -> None:
        """Show the entry in the place of the jog panel, with how it is understood."""
        self._ask.keep(view.state)
        self.set_class(self._ask.is_open, "-asking")
        if self._ask.is_open:
            title = self.ui.text(f"align_page.asked.{self._ask.entry_kind}")
            self._asked.show(asked_lines(self.ui.text, self._ask.question(view), *self._asked.size), title)

    def _switch_off(self, key: str) -> None:
        stops = self._jog.stops_what_moves(self.ui.control.state, key)
        if not stops and not self.ui.answers(self.why_not(key, self.ui.view)):
            self.ui.control.post(commands.DisableDrives())

    def _schedule_call(self, after_s: float, call: Callable[[], None]) -> None:
        if self.is_attached:
            self.set_timer(after_s, call)

    def _why_title(self, state: StationState, job: Job | None) -> str:
        text = self.ui.text
        if state.activity is Activity.LOST:
            return text("align_page.unknown_title")
        valid = align_lines.is_valid(state.alignment, job)
        return text("align_page.valid_title" if valid else "align_page.invalid_title")
