"""Runs that another console has left on this machine: asked for at opening, and by whoever takes control.

The record also tells whether the last cut ended early: then nobody knows what is in the chuck.

The console before may still be ending then: its mark is locked until it has written how it left the machine.
"""

from __future__ import annotations

from console.session.cut.alignment import after_last_cut
from console.session.data.records import held_marks, killed_or_refused
from console.session.data.run_reader import ended_early
from console.session.station.alarms import Priority
from console.session.station.context import StationContext

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
