"""Who works at the console that controls the machine, for observers; how many look on, for that console."""

from __future__ import annotations

from console.session.station.alarms import OUSTED, Priority, restate_alarm
from console.session.station.context import StationContext
from drivers.lathe.console_role import NOBODY
from profiles.problem import Problem

BESIDE = ("owner.held", "owner.beside")  # another console had control when this one was opened
READ_EVERY_S = 1.0
READINGS = 5  # of one console: it signs directly after its claim, or not at all


class HolderWatch:
    """Reads the signature of the controlling console, once for each; a console that controls reads nothing."""

    def __init__(self, context: StationContext) -> None:
        self._context = context
        self._holder, self._readings, self._next_s = NOBODY, 0, float("-inf")

    def look(self) -> None:
        """Read the signature if it is not known yet. Errors as for a poll."""
        context, state = self._context, self._context.state
        if context.onlookers is not None:
            context.onlookers.say(looks_on=not state.controls)
            if state.onlookers != context.onlookers.count:
                context.tell(onlookers=context.onlookers.count)
        if state.controls or state.holder == NOBODY:
            if state.held_by is not None:
                context.tell(held_by=None)
            if self._holder != NOBODY and not state.controls:
                self._report_gone_console()
            self._holder = NOBODY
            return
        if state.holder != self._holder:
            context.end_alarms("owner.free")
            self._holder, self._readings, self._next_s = state.holder, 0, float("-inf")
            context.tell(held_by=None)
        now_s = context.clock.now_s()
        if context.state.held_by is None and self._readings < READINGS and now_s >= self._next_s:
            self._readings, self._next_s = self._readings + 1, now_s + READ_EVERY_S
            by = context.lathe.signed_by(state.holder)
            context.tell(held_by=by)
            if by is not None:  # an alarm names whoever took control as the first row does
                taken = Problem(code=OUSTED, value=f"{state.holder} ({by.name}@{by.shown_host})")
                context.change_alarms(lambda alarms: restate_alarm(alarms, taken))

    def _report_gone_console(self) -> None:
        """Report that the controlling console has gone, so that its requests are void."""
        context = self._context
        if not any(context.has_alarm(code) for code in BESIDE):
            return
        context.change_alarms(lambda alarms: tuple(each for each in alarms if each.problem.code not in BESIDE))
        context.alarm(Problem(code="owner.free"), Priority.MEDIUM)
