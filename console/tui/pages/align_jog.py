"""Jogging on the page Align: one step per press, while enabled. What cannot be done now shows why."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from console.session.cut.alignment import AlignStep
from console.session.station.commands import Jog
from console.session.station.jogging import JogEnable, Steps, is_too_long, longest_toward_mm
from console.session.station.state import Activity, StationState
from console.tui.pages.align_lines import step_now
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

REPEAT_S = 0.12  # presses of one key closer together are a terminal's repeats of a held key
FIRST_REPEAT_S = 0.7  # longest delay before a terminal repeats a held key, in most settings
SURE_S = 0.06  # decision time for a press that may be such a repeat: the next one follows some 30 ms after it
SERIES_S = 2.0  # presses further apart are counted anew

Later = Callable[[float, Callable[[], None]], None]
"""Call a function after this many seconds, while the page exists."""


class JogPresses:
    """Presses of one jog key. `taken` are steps that were commanded, `missed` came during motion.

    `held`: the key repeats. Times are of any monotonic clock. No press is decided later than `SURE_S`
    after it: nothing waits for the end of a motion.
    """

    def __init__(self) -> None:
        self.taken = self.missed = 0
        self.held = False
        self._key: str | None = None
        self._pressed_s = -math.inf
        self._sure_at_s: float | None = None

    def forget(self) -> None:
        """Reset after another key or a stop: nothing waits, and the count begins anew."""
        self.taken = self.missed = 0
        self.held = False
        self._key, self._sure_at_s = None, None

    def press(self, key: str, now_s: float, *, at_rest: bool) -> bool:
        """Note a press; return whether it is a step now. For one that `waits`, `due` decides."""
        gap_s = now_s - self._pressed_s if key == self._key else math.inf
        if gap_s > SERIES_S:
            self.forget()
        self._key, self._pressed_s, self._sure_at_s = key, now_s, None
        self.held = gap_s < REPEAT_S
        if self.held:
            return False
        if gap_s < FIRST_REPEAT_S:
            self._sure_at_s = now_s + SURE_S
            return False
        return self._decided(at_rest=at_rest)

    @property
    def waits(self) -> bool:
        """Whether a press waits until it is known to be no repeat."""
        return self._sure_at_s is not None

    def due(self, now_s: float, *, at_rest: bool) -> str | None:
        """Return the key of a press that was no repeat, once, where it is a step."""
        if self._sure_at_s is None or now_s < self._sure_at_s:
            return None
        self._sure_at_s = None
        return self._key if self._decided(at_rest=at_rest) else None

    def _decided(self, *, at_rest: bool) -> bool:
        self.taken += at_rest
        self.missed += not at_rest
        return at_rest

    def refused(self) -> None:
        """Withdraw the last step: the machine was still busy."""
        self.taken -= 1
        self.missed += 1


class JogKeys:
    """Jog keys of one page: whether enabled, the selected steps, and the accepted presses."""

    def __init__(self, ui: UiContext, later: Later) -> None:
        self.ui = ui
        self._later = later
        self._steps = Steps()
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

    def why_not(self, key: str, state: StationState, now_s: float) -> tuple[Problem, ...]:
        """Return why a jog key makes no step from rest: the machine, no enable, or too long a step."""
        if reasons := refusal(state, key):
            return reasons
        if self._jog is None or not self._jog.holds(state, now_s):
            return (Problem(code="screen.jog_not_enabled"),)
        return self._too_long(key, state)

    def _too_long(self, key: str, state: StationState) -> tuple[Problem, ...]:
        step = self._steps.of(JOGS[key][0])
        longest = longest_toward_mm(state.snapshot, self.ui.machine.machine, state.alignment)
        if key != "align.in" or not is_too_long(step, longest):
            return ()
        return (Problem(code="screen.step_too_long", value=f"{step:.3f} mm", limit=f"<= {longest:.3f} mm"),)

    def enable(self, key: str) -> None:
        """Enable the jog keys for a while."""
        if not self.ui.refuses(key):
            self._jog = JogEnable(used_s=self.ui.control.now_s(), stops=self.ui.control.state.stops)

    def change_rung(self, key: str) -> None:
        """Select the next longer or shorter step of the axis."""
        state = self.ui.control.state
        if state.activity is Activity.JOGGING and self.stops_what_moves(state, key):
            return
        self._steps = self._steps.changed(self._axis(state), 1 if key == "align.larger" else -1)
        self.renew(self.ui.control.now_s())

    def press(self, key: str) -> None:
        """Handle a jog key: one step per press at rest; other presses are counted and reported."""
        state, now_s = self.ui.control.state, self.ui.control.now_s()
        continues = state.activity is Activity.JOGGING and key == self.ui.jog
        if not continues and (self.stops_what_moves(state, key) or self.ui.refuses(key)):
            self._presses.forget()
            return
        self.let_go(state, now_s)
        if self._jog is None:
            self.ui.say("screen.jog_not_enabled")
            return
        if self._presses.press(key, now_s, at_rest=not state.moving):
            self._jog_by(key, state)
        elif self._presses.waits:
            self._later(1.1 * SURE_S, self.press_due)
        self._report_presses(key)

    def press_due(self) -> None:
        """Handle a press that might have been the first repeat of a held key, and was not."""
        state, now_s = self.ui.control.state, self.ui.control.now_s()
        self.let_go(state, now_s)
        if self._jog is None:
            self._presses.forget()
            return
        decides = self._presses.waits
        key = self._presses.due(now_s, at_rest=not state.moving)
        if key is not None and not self.ui.refuses(key):
            self._jog_by(key, state)
        if decides and not self._presses.waits and self.ui.jog is not None:
            self._report_presses(self.ui.jog)

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
        return JogView(
            machine=self.ui.machine.machine,
            state=state,
            steps=self._steps,
            axis=self._axis(state),
            made=self._presses.taken,
            left_s=None if self._jog is None else self._jog.left_s(now_s),
        )

    def stops_what_moves(self, state: StationState, key: str) -> bool:
        """Stop first: another axis, direction or step during motion is a change of mind."""
        if not state.moving:
            return False
        self.ui.say_until_key(Problem(code="screen.key_in_motion", key=KEYS[key]))
        self.ui.control.stop(f"change {KEYS[key]}")
        return True

    def _axis(self, state: StationState) -> AxisName:
        """Return the axis whose step + and - change: the last one jogged in this step, else that of the step."""
        step = step_now(state.alignment, self.ui.job)
        if self._jogged is not None and self._jogged[0] is step:
            return self._jogged[1]
        return AxisName.SPINDLE if step is AlignStep.JAW else AxisName.TOOL

    def _jog_by(self, key: str, state: StationState) -> None:
        axis, sign = JOGS[key]
        step = self._steps.of(axis)
        if self.ui.answers(self._too_long(key, state)):
            self._presses.forget()
            return
        self._jogged, self.ui.jog = (step_now(state.alignment, self.ui.job), axis), key
        self.renew(self.ui.control.now_s())
        if not self.ui.control.post(Jog(axis=axis, distance=sign * step)):
            self._presses.refused()

    def _report_presses(self, key: str) -> None:
        """Report which presses made no step; the text stays, because the machine comes to rest soon after."""
        presses = self._presses
        if presses.held:
            self.ui.say_until_key(Problem(code="screen.jog_key_held", key=KEYS[key]))
        elif presses.missed:
            missed, pressed = str(presses.missed), str(presses.missed + presses.taken)
            code = "screen.presses_missed"
            self.ui.say_until_key(Problem(code=code, key=KEYS[key], value=missed, limit=pressed))
