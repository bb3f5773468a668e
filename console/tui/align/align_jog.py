"""Jogging on the page Align: every press is one step, while enabled. What cannot be done now shows why."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from console.session.cut.alignment import AlignStep, step_now
from console.session.station.commands import GoTo, Jog, NoteJog
from console.session.station.durations import jog_s
from console.session.station.jogging import JogEnable, Steps, speed_problem, step_problem
from console.session.station.state import Activity, StationState
from console.tui.align.hold_run import (
    CALIBRATION_S,
    LONGEST_STEP_S,
    MOST_GAP_S,
    SURE_S,
    UNMEASURED,
    HoldRun,
    JogPresses,
    KeyRepeatCalibration,
    Overrun,
    Repeat,
    ReportedStrokes,
    Tier,
    overrun,
)
from console.tui.application.key_releases import SLOWEST_S
from console.tui.pages.jog_lines import JogView
from console.tui.ui_context import KEYS, UiContext, refusal
from drivers.lathe.snapshot import AxisName
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

GO = "align.go"  # the key that starts a go-to

Later = Callable[[float, Callable[[], None]], None]
"""Call a function after this many seconds, while the page exists."""

MOST_WAITING = 10
"""Steps that may wait. More could come only of a terminal that repeats a held key slowly."""

SERIES_S = 2.0  # presses further apart than this are counted anew
HELD_UP_S = 1.0  # a screen that was not drawn for so long had something else to do: nothing continues after it


def hold_the_key() -> Problem:
    """Return what the key of the calibration asks for: to be held down, which only it can be."""
    return Problem(code="screen.hold_the_key", limit=f"{CALIBRATION_S:.0f} s")


@dataclass(frozen=True, slots=True)
class _PostedStep:
    """State of the machine when a step was posted."""

    jogs: int
    refusals: tuple[Problem, ...]


class StepQueue:
    """Steps of one key. `asked` and `made` count those of the present series. Times are machine time.

    The queue is in the screen, so that nothing moves any more when the screen is gone.
    """

    def __init__(self) -> None:
        self.key: str | None = None
        self.asked = self.made = 0
        self._posted: _PostedStep | None = None
        self._asked_s = self._followed_s = -math.inf

    @property
    def steps_left(self) -> int:
        """Steps that were asked for and are not made, with the one under way."""
        return self.asked - self.made

    @property
    def waiting(self) -> int:
        """Steps that were not commanded yet."""
        return self.steps_left - (self._posted is not None)

    @property
    def is_due(self) -> bool:
        """Whether the next step is to be commanded, as soon as the machine is at rest."""
        return self._posted is None and self.steps_left > 0

    def add(self, key: str, now_s: float) -> bool:
        """Ask for one more step; return False if too many wait already."""
        if self.waiting >= MOST_WAITING:
            return False
        if key != self.key or (not self.steps_left and now_s - self._asked_s > SERIES_S):
            self.asked = self.made = 0
        if not self.steps_left:
            self._followed_s = now_s
        self.key, self._asked_s = key, now_s
        self.asked += 1
        return True

    def note_posted_step(self, state: StationState) -> None:
        """Note that the next step was commanded in this state."""
        self._posted = _PostedStep(state.jogs, state.refusals)

    def follow(self, state: StationState, now_s: float) -> bool:
        """Note what became of the step under way; return False if those that wait were dropped.

        They are dropped with a step that the machine has refused, and after a screen that was held up.
        """
        held_up, self._followed_s = now_s - self._followed_s > HELD_UP_S, now_s
        step = self._posted
        if step is not None and state.jogs != step.jogs:
            self.made, self._posted = self.made + 1, None
        elif step is not None and not state.moving and state.refusals and state.refusals is not step.refusals:
            self.forget()
            return False
        if held_up and self.waiting:
            self.drop()
            return False
        return True

    def drop(self) -> int:
        """Drop the steps that wait, and return their number; the one under way goes to its end."""
        dropped = self.waiting
        if self._posted is None:
            self.forget()
        else:
            self.asked -= dropped
        return dropped

    def forget(self) -> None:
        """Drop every step and the count: the machine was stopped, or something else is asked of it."""
        self.asked = self.made = 0
        self.key, self._posted = None, None


class JogKeys:
    """Jog keys of one page: whether enabled, the selected steps, and the steps that were asked for."""

    def __init__(self, ui: UiContext, later: Later) -> None:
        self.ui = ui
        self._later = later
        self._steps = Steps()
        self._jogged: tuple[AlignStep | None, AxisName] | None = None
        self._jog: JogEnable | None = None
        self._presses, self._queue = JogPresses(), StepQueue()
        self._hold, self._calibration, self._strokes = HoldRun(), KeyRepeatCalibration(), ReportedStrokes()

    def drop_waiting_steps(self, key: str | None) -> None:
        """Drop the steps that wait at any key but their own; the one under way goes to its end."""
        if key is None or key != self._queue.key:
            self._presses.forget()
            self._hold.end()
            self._queue.drop()
            self._tell()

    def end(self) -> None:
        """Disable the jog; no step waits any more."""
        if self._jog is not None:
            self._jog = None
            self.ui.control.post(NoteJog(enabled=False))
        self._forget()

    def _forget(self) -> None:
        self._presses.forget()
        self._hold.end()
        self._queue.forget()
        self._tell()

    def _tell(self) -> None:
        """Let the gate of the keys know of steps: between two of them the machine is at rest, but goes on."""
        self.ui.queued = self._queue.steps_left > 0

    def why_not(self, key: str, state: StationState, now_s: float) -> tuple[Problem, ...]:
        """Return why a jog key makes no step from rest: the machine, no enable, or too long a step."""
        if reasons := refusal(state, key):
            return reasons
        if self._jog is None or not self._jog.holds(state, now_s):
            return (Problem(code="screen.jog_not_enabled"),)
        return self._too_long(key, state) or self._too_fast(key)

    def _too_fast(self, key: str) -> tuple[Problem, ...]:
        axis = JOGS[key][0]
        problem = speed_problem(self.ui.machine.machine, axis, self._steps.step_length(axis))
        return () if problem is None else (problem,)

    def why_not_go(self, state: StationState, now_s: float) -> tuple[Problem, ...]:
        """Return why a go-to does not begin, whatever its target: the machine, or no enable."""
        if reasons := refusal(state, GO):
            return reasons
        enabled = self._jog is not None and self._jog.holds(state, now_s)
        return () if enabled else (Problem(code="screen.jog_not_enabled"),)

    def go(self, axis: AxisName, target: float) -> None:
        """Go to a target: one motion, no steps."""
        self._forget()
        self._jogged = step_now(self.ui.control.state.alignment, self.ui.job), axis
        self.ui.jog = GO
        self.renew(self.ui.control.now_s())
        self.ui.control.post(GoTo(axis=axis, target=target))

    def _too_long(self, key: str, state: StationState) -> tuple[Problem, ...]:
        step = self._steps.step_length(JOGS[key][0])
        if key != "align.in":
            return ()
        problem = step_problem(step, state.snapshot, self.ui.machine.machine, state.alignment)
        if problem is not None and problem.code == "machine.step_too_long":
            problem = Problem(code="screen.step_too_long", value=problem.value, limit=problem.limit)
        return () if problem is None else (problem,)

    def enable(self, key: str) -> None:
        """Enable the jog keys for a while."""
        if not self.ui.refuses(key):
            self._jog = JogEnable(used_s=self.ui.control.now_s(), stops=self.ui.control.state.stops)
            self.ui.control.post(NoteJog(enabled=True))

    def change_rung(self, key: str) -> None:
        """Select the next longer or shorter step of the axis."""
        state = self.ui.control.state
        self._see(state, self.ui.control.now_s())
        jogs = state.activity is Activity.JOGGING or self.ui.queued
        if jogs and self.stops_what_moves(state, key):
            return
        self._steps = self._steps.change_step(self._axis(state), 1 if key == "align.larger" else -1)
        self.renew(self.ui.control.now_s())

    def press(self, key: str) -> None:
        """Handle a jog key: each press is one step; those of a moving machine wait for the steps before them."""
        state, now_s = self.ui.control.state, self.ui.control.now_s()
        self._see(state, now_s)
        if self._presses.take_due_key(now_s) == key:
            self._finger(key, now_s)
        continues = key == self.ui.jog and (state.activity is Activity.JOGGING or self.ui.queued)
        if not continues and (self.stops_what_moves(state, key) or self.ui.refuses(key)):
            self._forget()
            return
        if self._jog is None:
            self.ui.say("screen.jog_not_enabled")
            return
        stroke = self.ui.stroke
        if stroke is not None:
            self._presses.forget()
            if self._strokes.is_finger(stroke, now_s):
                self._press_reported(key, now_s)
                return
            held = stroke.repeated
        elif self._presses.press(key, now_s):
            self._finger(key, now_s)
            return
        else:
            held = self._presses.held
        if self._presses.waits:
            self._later(1.1 * SURE_S, self.follow)
        elif held and self._why_no_hold(key) is None and self.repeat is not None:
            self._hold.repeat(now_s, self.repeat, None if stroke is None else stroke.releases)
            self.follow()
        else:
            self.ui.say_until_key(self._why_no_hold(key) or Problem(code="screen.jog_key_held", key=KEYS[key]))

    def _press_reported(self, key: str, now_s: float) -> None:
        """Take a press that the terminal calls one; the first after a line that stood still may be an old one."""
        if self._hold.lost:
            self._hold.lost = False
            self.ui.say_until_key(Problem(code="screen.press_was_late", key=KEYS[key]))
        else:
            self._finger(key, now_s)

    def _finger(self, key: str, now_s: float) -> None:
        """Take a press of a finger: one step, and perhaps the begin of a held key."""
        self._hold.begin(now_s)
        self._ask(key)

    @property
    def tier(self) -> Tier:
        """What a held key does here, by what the terminal was measured to do."""
        releases = self.ui.releases
        if releases is not None and releases.confirmed:
            return Tier.RELEASE if releases.in_force else Tier.STEP
        return Tier.STEP if self._calibration.measured is None else Tier.REPEAT

    @property
    def repeat(self) -> Repeat | None:
        """How the terminal repeats a held key; None if a held key makes single steps."""
        if self.tier is Tier.RELEASE:
            return self._calibration.measured or UNMEASURED
        return None if self.tier is Tier.STEP else self._calibration.measured

    def _runs(self, now_s: float) -> bool:
        releases = self.ui.releases
        heard = releases.count if releases is not None and releases.confirmed else None
        return self._hold.runs(now_s, self.repeat, heard)

    def calibrate(self) -> None:
        """Measure the repeat of the terminal while its key is held. Nothing moves."""
        now_s = self.ui.control.now_s()
        if not self._calibration.press(now_s):
            self.ui.say_until_key(hold_the_key())
        elif (repeat := self._calibration.measured) is None:
            self.ui.say_until_key(Problem(code="screen.no_repeat", limit=f"{1000.0 * MOST_GAP_S:.0f} ms"))
        else:
            value, limit = f"{1000.0 * repeat.gap_s:.0f} ms", f"{1000.0 * repeat.timeout_s:.0f} ms"
            self.ui.say_until_key(Problem(code="screen.repeat_measured", value=value, limit=limit))

    def _why_no_hold(self, key: str) -> Problem | None:
        """Return why a held key is one step; None if it runs. The tool goes to the work by presses alone."""
        releases, limit = self.ui.releases, f"{1000.0 * SLOWEST_S:.0f} ms"
        if releases is not None and releases.is_slow:
            value = f"> {limit}" if releases.late else f"{1000.0 * (releases.round_trip_s or 0.0):.0f} ms"
            return Problem(code="screen.releases_late", value=value, limit=limit)
        if self.repeat is None:
            return Problem(code="screen.jog_key_held", key=KEYS[key])
        if key == "align.in":
            return Problem(code="screen.no_hold_to_work", key=KEYS[key])
        axis = JOGS[key][0]
        step_s = jog_s(self.ui.machine.machine, axis, self._steps.step_length(axis))
        if step_s > LONGEST_STEP_S:
            return Problem(code="screen.no_hold_long", value=f"{step_s:.1f} s", limit=f"{LONGEST_STEP_S:.1f} s")
        return None

    def follow(self) -> None:
        """Command the next step, once the one before is made; at each tick, and when a press is decided."""
        state, now_s = self.ui.control.state, self.ui.control.now_s()
        self._see(state, now_s)
        if self._jog is None:
            return
        if (key := self._presses.take_due_key(now_s)) is not None:
            self._finger(key, now_s)
        held = self._queue.key
        if held is not None and not self._queue.steps_left and not state.moving and self._runs(now_s):
            self._ask(held)
        self._post_next(state)
        self._tell()

    def _see(self, state: StationState, now_s: float) -> None:
        """Note what became of the enabled jog and of the step under way; nothing is commanded."""
        self.let_go(state, now_s)
        stopped = (
            self._queue.steps_left > 0 and not self.ui.queued
        )  # by a key, in the thread that reads the terminal
        if self._jog is None or stopped:
            self._forget()
            return
        waited = self._queue.waiting
        if not self._queue.follow(state, now_s) and not state.refusals:
            self.ui.say_until_key(Problem(code="screen.steps_held_up", value=str(waited)))
        self._tell()

    def _ask(self, key: str) -> None:
        """Take one more step into the queue; it is commanded at once where the machine is at rest."""
        state = self.ui.control.state
        if self._queue.steps_left == 0 and self.ui.answers(self.why_not(key, state, self.ui.control.now_s())):
            self._presses.forget()
            return
        if not self._queue.add(key, self.ui.control.now_s()):
            self.ui.say_until_key(Problem(code="screen.steps_full", key=KEYS[key], limit=str(MOST_WAITING)))
        self.ui.jog = key
        self._post_next(state)
        self._tell()

    def _post_next(self, state: StationState) -> None:
        """Command the next step at rest, unless something is against it: then none of them is made."""
        key = self._queue.key
        if key is None or not self._queue.is_due or state.moving:
            return
        if self.ui.answers(self.why_not(key, state, self.ui.control.now_s())):
            self._forget()
            return
        axis, sign = JOGS[key]
        self._jogged = step_now(state.alignment, self.ui.job), axis
        self.renew(self.ui.control.now_s())
        self._queue.note_posted_step(state)
        if not self.ui.control.post(Jog(axis=axis, distance=sign * self._steps.step_length(axis))):
            self._forget()

    def let_go(self, state: StationState, now_s: float) -> None:
        """Disable the jog after its timeout or a stop."""
        if self._jog is not None and not self._jog.holds(state, now_s):
            self.end()

    def renew(self, now_s: float) -> None:
        """Restart the idle time."""
        if self._jog is not None:
            self._jog = replace(self._jog, used_s=now_s)

    def view(self, state: StationState, now_s: float) -> JogView:
        """Return what the panel of the jog shows."""
        return JogView(
            machine=self.ui.machine.machine,
            state=state,
            steps=self._steps,
            axis=self._axis(state),
            made=self._queue.made,
            asked=self._queue.asked,
            now_s=now_s,
            overrun=self._overrun(state),
            left_s=None if self._jog is None else self._jog.left_s(now_s),
        )

    def _overrun(self, state: StationState) -> Overrun | None:
        """Return how far the axis may still go after a held key is released, mm or degrees; None: step only."""
        axis, repeat, releases = self._axis(state), self.repeat, self.ui.releases
        if repeat is None:
            return None
        step = self._steps.step_length(axis)
        step_s = jog_s(self.ui.machine.machine, axis, step)
        if step_s > LONGEST_STEP_S:
            return None
        heard = None if self.tier is not Tier.RELEASE or releases is None else releases.round_trip_s
        return overrun(repeat, step, step_s, heard)

    def stops_what_moves(self, state: StationState, key: str) -> bool:
        """Stop first: another axis, direction or step during motion is a change of mind."""
        if not (state.moving or self.ui.queued):
            return False
        self.ui.say_until_key(Problem(code="screen.key_in_motion", key=KEYS[key]))
        self.ui.stop(f"change {KEYS[key]}")
        return True

    def _axis(self, state: StationState) -> AxisName:
        """Return the axis whose step + and - change: the last one jogged in this step, else that of the step."""
        step = step_now(state.alignment, self.ui.job)
        if self._jogged is not None and self._jogged[0] is step:
            return self._jogged[1]
        return AxisName.SPINDLE if step is AlignStep.JAW else AxisName.TOOL
