"""Other consoles at this machine: who works at the one that controls it, and the runs that they have left.

How many look on is for the console that controls. Runs that were left are asked for at opening, and by whoever
takes control. The record also tells whether the last cut ended early: then nobody knows what is in the chuck. The
console before may still be ending then: its mark is locked until it has written how it left the machine.
"""

from __future__ import annotations

from console.session.cut.alignment import after_last_cut
from console.session.data.records import held_marks, killed_or_refused
from console.session.data.run_reader import ended_early
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


LOOK_EVERY_S = 1.0


class LeftRuns:
    """Asks for them. While marks of other consoles are held, it waits for each to be let go."""

    def __init__(self, context: StationContext) -> None:
        self._context = context
        self._held: frozenset[str] = frozenset()
        self._next_s = float("-inf")

    def watch(self) -> None:
        """Wait for the runs that are not over now, and tell how the last cut ended."""
        context = self._context
        self._held = held_marks(context.records)
        # A simulated lathe begins with a blank; and the cut of another console that runs now has no end yet.
        if context.shop is None and context.state.controls:
            early = ended_early(context.records, context.loaded_machine.machine.name)
            context.tell(alignment=after_last_cut(context.state.alignment, ended_early=early))

    def ask(self) -> None:
        """Raise an alarm for each run that was left, and watch those that are not over."""
        self.watch()  # first: what is let go from here on is found by the next poll
        context = self._context
        machine, simulated = context.loaded_machine.machine.name, context.shop is not None
        for problem in killed_or_refused(context.records, machine, simulated=simulated, checked=False):
            if not context.alarmed_of(problem):
                context.alarm(problem, Priority.MEDIUM)

    def look(self) -> None:
        """Ask again once a mark has been let go that was held; a console that controls does so at rest."""
        if not self._held or self._context.clock.now_s() < self._next_s:
            return
        self._next_s = self._context.clock.now_s() + LOOK_EVERY_S
        if not self._held <= held_marks(self._context.records):
            self.ask()
