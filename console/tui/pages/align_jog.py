"""Jogging on the page Align: one step per press, while enabled. What cannot be done now shows why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from console.session.cut.alignment import AlignStep
from console.session.station.commands import Jog
from console.session.station.jogging import JogEnable, Steps, is_too_long, longest_toward_mm
from console.session.station.state import Activity, StationState
from console.tui.keymap import ACTIONS
from console.tui.pages.align_lines import step_now
from console.tui.pages.jog_lines import JogView
from console.tui.pages.jog_presses import SURE_S, JogPresses
from console.tui.ui_context import UiContext
from console.tui.waiting import refusal
from drivers.lathe.snapshot import AxisName
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

Later = Callable[[float, Callable[[], None]], None]
"""Call a function after this many seconds, while the page exists."""


class JogKeys:
    """Jog keys of one page: whether enabled, the selected steps, and the accepted presses."""

    def __init__(self, desk: UiContext, later: Later) -> None:
        self.desk = desk
        self._later = later
        self._step_lengths = Steps()
        self._jogged: tuple[AlignStep | None, AxisName] | None = None
        self._jog: JogEnable | None = None
        self._presses = JogPresses()

    @property
    def enabled(self) -> bool:
        """Whether the jog keys move the machine now."""
        return self._jog is not None

    def forget(self) -> None:
        """Forget the presses that wait; another key came between them."""
        self._presses.forget()

    def end(self) -> None:
        """Disable the jog."""
        self._jog = None
        self._presses.forget()

    def enable(self, key: str) -> None:
        """Enable the jog keys for a while."""
        state = self.desk.control.state
        if not self.refuses(state, key):
            self._jog = JogEnable(used_s=self.desk.control.now_s(), stops=state.stops)

    def change_rung(self, key: str) -> None:
        """Select the next longer or shorter step of the axis."""
        state = self.desk.control.state
        if state.activity is Activity.JOGGING and self.stops_what_moves(state, key):
            return
        step = 1 if key == "align.larger" else -1
        self._step_lengths = self._step_lengths.changed(self._axis(state), step)
        self.renew(self.desk.control.now_s())

    def press(self, key: str) -> None:
        """Handle a jog key: one step per press at rest; other presses are counted and reported."""
        state, now_s = self.desk.control.state, self.desk.control.now_s()
        goes_on = state.activity is Activity.JOGGING and key == self.desk.jog
        if not goes_on and (self.stops_what_moves(state, key) or self.refuses(state, key)):
            self._presses.forget()
            return
        self.let_go(state, now_s)
        if self._jog is None:
            self._say("screen.jog_not_enabled")
            return
        if self._presses.press(key, now_s, at_rest=not state.moving):
            self._jog_by(key, state)
        elif self._presses.waits:
            self._later(1.1 * SURE_S, self.press_due)
        self._tell_presses(key)

    def press_due(self) -> None:
        """Handle a press that might have been the first repeat of a held key, and was not."""
        state, now_s = self.desk.control.state, self.desk.control.now_s()
        self.let_go(state, now_s)
        if self._jog is None:
            self._presses.forget()
            return
        decides = self._presses.waits
        key = self._presses.due(now_s, at_rest=not state.moving)
        if key is not None and not self.refuses(state, key):
            self._jog_by(key, state)
        if decides and not self._presses.waits and self.desk.jog is not None:
            self._tell_presses(self.desk.jog)

    def let_go(self, state: StationState, now_s: float) -> None:
        """Disable the jog after its timeout or a stop."""
        if self._jog is not None and not self._jog.holds(state, now_s):
            self._jog = None
            self._presses.forget()

    def renew(self, now_s: float) -> None:
        """Restart the idle time."""
        if self._jog is not None:
            self._jog = replace(self._jog, used_s=now_s)

    def view(self, state: StationState, now_s: float) -> JogView:
        """Return what the panel of the jog shows."""
        machine = self.desk.machine.machine
        return JogView(
            machine=machine,
            steps=self._step_lengths,
            axis=self._axis(state),
            made=self._presses.taken,
            left_s=None if self._jog is None else self._jog.left_s(now_s),
            moving=state.moving,
            longest_mm=longest_toward_mm(state.snapshot, machine, state.alignment),
            simulated=state.simulated,
            seen=None if state.activity is Activity.LOST else state.seen,
        )

    def refuses(self, state: StationState, key: str) -> bool:
        """Show why the station cannot take a command now, if it cannot."""
        problem = refusal(state, _KEYS[key])
        if problem is not None:
            self.desk.said = (problem,)
        return problem is not None

    def stops_what_moves(self, state: StationState, key: str) -> bool:
        """Stop first: another axis, direction or step during motion is a change of mind."""
        if not state.moving:
            return False
        self.desk.say_until_key(Problem(code="screen.key_in_motion", key=_KEYS[key]))
        self.desk.control.stop(f"change {_KEYS[key]}")
        return True

    def _axis(self, state: StationState) -> AxisName:
        """Return the axis whose step + and - change: the last one jogged in this step, else that of the step."""
        step = step_now(state.alignment, self._job)
        if self._jogged is not None and self._jogged[0] is step:
            return self._jogged[1]
        return AxisName.SPINDLE if step is AlignStep.JAW else AxisName.TOOL

    def _jog_by(self, key: str, state: StationState) -> None:
        axis, sign = JOGS[key]
        step = self._step_lengths.of(axis)
        longest = longest_toward_mm(state.snapshot, self.desk.machine.machine, state.alignment)
        if key == "align.in" and is_too_long(step, longest):
            self._presses.forget()
            self._say("screen.step_too_long", value=f"{step:.3f} mm", limit=f"<= {longest:.3f} mm")
            return
        self._jogged, self.desk.jog = (step_now(state.alignment, self._job), axis), key
        self.renew(self.desk.control.now_s())
        if not self.desk.control.post(Jog(axis=axis, distance=sign * step)):
            self._presses.refused()

    def _tell_presses(self, key: str) -> None:
        """Report which presses made no step; the text stays, because the machine comes to rest soon after."""
        presses = self._presses
        if presses.held:
            self.desk.say_until_key(Problem(code="screen.jog_key_held", key=_KEYS[key]))
        elif presses.missed:
            pressed = str(presses.missed + presses.taken)
            self.desk.say_until_key(
                Problem(code="screen.presses_missed", key=_KEYS[key], value=str(presses.missed), limit=pressed)
            )

    @property
    def _job(self) -> Job | None:
        return None if self.desk.work is None else self.desk.work.job

    def _say(self, code: str, *, value: str = "", limit: str = "") -> None:
        self.desk.said = (Problem(code=code, value=value, limit=limit),)
