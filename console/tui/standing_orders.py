"""Commands available on every page: recover after a stop, take control, acknowledge alarms, quit."""

from __future__ import annotations

from console.session.station.alarms import foremost
from console.tui.ui_context import UiContext
from profiles.job import Job
from profiles.problem import Problem

TAKE_OVER_WITHIN_S = 5.0  # time in which the key that takes control has to be pressed again


class StandingOrders:
    """Commands available on any page. Command classes are imported on use: not for the first paint."""

    def __init__(self, ui: UiContext) -> None:
        self._ui = ui
        self._asked_over_s = float("-inf")
        self._given_up: Job | None = None

    def why_not(self, action: str) -> tuple[Problem, ...]:
        """Return why an action of every page has no effect now."""
        state, code = self._ui.control.state, ""
        match action:
            case "recover" if (
                state.speed and state.stop is None and (state.snapshot is None or not state.snapshot.lost)
            ):
                code = "screen.nothing_to_recover"
            case "acknowledge" if not state.alarms:
                code = "screen.nothing_to_acknowledge"
            case "take_over" if state.controls:
                code = "screen.controls_already"
            case "quit" if state.moving:
                code = "screen.quit_moving"
            case "palette" if state.may_move or state.seen_moving:
                code = "screen.palette_moving"
        return (Problem(code=code),) if code else ()

    def recover(self) -> None:
        """Recover after a stop or the loss of the machine."""
        from console.session.station.commands import Recover

        if not self._ui.answers(self.why_not("recover")):
            self._ui.control.post(Recover())

    def take_control(self) -> None:
        """Take control from another console; needs a second press, because somebody works there."""
        from console.session.station.commands import TakeControl

        ui = self._ui
        if ui.answers(self.why_not("take_over")):
            return
        if ui.control.now_s() - self._asked_over_s > TAKE_OVER_WITHIN_S:
            self._asked_over_s = ui.control.now_s()
            code = "screen.take_over_again" if ui.control.state.holder else "screen.take_control_again"
            ui.say(code, limit=f"{TAKE_OVER_WITHIN_S:g} s")
        else:
            self._asked_over_s = float("-inf")
            ui.control.post(TakeControl())

    def acknowledge(self, *, all_of_them: bool, chosen: Problem | None = None) -> None:
        """Acknowledge what is shown: the chosen alarm, the one in the row, or all in the list of messages."""
        from console.session.station.commands import Acknowledge

        if self._ui.answers(self.why_not("acknowledge")):
            return
        alarms = self._ui.control.state.alarms
        front = foremost(alarms)
        listed = tuple(alarm.problem for alarm in (alarms if all_of_them or front is None else (front,)))
        self._ui.control.post(Acknowledge(shown=listed if all_of_them or chosen is None else (chosen,)))

    def may_quit(self) -> bool:
        """Whether nothing moves and no edit is lost that was not given up by pressing the key again."""
        ui = self._ui
        state, work = ui.control.state, ui.draft or ui.work
        if state.moving:
            ui.say("screen.quit_moving")
            return False
        if work is not None and work.edited and work.job is not self._given_up:
            self._given_up = work.job
            ui.say("screen.quit_unsaved", value=work.job.name or ui.text("setup.new_title"))
            return False
        return True
