"""Commands available on every page: recover after a stop, take control, acknowledge alarms."""

from __future__ import annotations

from console.session.station.alarms import foremost
from console.tui.ui_context import UiContext
from profiles.problem import Problem

TAKE_OVER_WITHIN_S = 5.0  # time in which the key that takes control has to be pressed again


class StandingOrders:
    """Commands available on any page. Command classes are imported on use: not for the first paint."""

    def __init__(self, ui: UiContext) -> None:
        self._ui = ui
        self._asked_over_s = float("-inf")

    def recover(self) -> None:
        """Recover after a stop or the loss of the machine."""
        from console.session.station.commands import Recover

        state = self._ui.control.state
        if state.stop is not None or (state.snapshot is not None and state.snapshot.lost):
            self._ui.control.post(Recover())

    def take_control(self) -> None:
        """Take control from another console; needs a second press, because somebody works there."""
        from console.session.station.commands import TakeControl

        ui = self._ui
        if ui.control.state.controls:
            ui.say("screen.controls_already")
        elif ui.control.now_s() - self._asked_over_s > TAKE_OVER_WITHIN_S:
            self._asked_over_s = ui.control.now_s()
            code = "screen.take_over_again" if ui.control.state.holder else "screen.take_control_again"
            ui.say(code, limit=f"{TAKE_OVER_WITHIN_S:g} s")
        else:
            self._asked_over_s = float("-inf")
            ui.control.post(TakeControl())

    def acknowledge(self, *, all_of_them: bool, chosen: Problem | None = None) -> None:
        """Acknowledge what is shown: the chosen alarm, the one in the row, or all in the list of messages."""
        from console.session.station.commands import Acknowledge

        alarms = self._ui.control.state.alarms
        front = foremost(alarms)
        listed = tuple(alarm.problem for alarm in (alarms if all_of_them or front is None else (front,)))
        self._ui.control.post(Acknowledge(shown=listed if all_of_them or chosen is None else (chosen,)))
