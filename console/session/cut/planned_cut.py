"""A cut held against its plan: before it starts, at each poll while it runs, and when it has ended.

A part is called good only where what was cut is what was planned. Screens and headless runs ask the same.
"""

from __future__ import annotations

from dataclasses import replace

from console.session.errors import SessionError
from drivers.cutting.guarding import CutLength, ProgramEnd, cut_guard, end_problems
from drivers.cutting.path_seen import PathSeen
from drivers.cutting.planning import CutPlan
from drivers.errors import DriverError, LinkError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from profiles.problem import Problem


def refuse_unless_held(lathe: Lathe, plan: CutPlan, *, tables: bool = True) -> None:
    """Make sure that the controller holds the cut as it was loaded, before anything of it moves.

    Raises:
        SessionError: what somebody else has changed.
        LinkError: the link broke.
    """
    try:
        lathe.program.holds(plan.program, tables=tables)
    except LinkError:
        raise
    except DriverError as changed:
        raise SessionError(*changed.problems) from changed


class PlannedCut:
    """One cut, from its start to its end. `end` is what its program said, once it was asked."""

    def __init__(self, lathe: Lathe, plan: CutPlan) -> None:
        self.end: ProgramEnd | None = None
        self.guard = cut_guard(plan, lathe.machine)
        self._lathe, self._plan = lathe, plan
        self._length = CutLength(plan, lathe.machine)
        self._path = PathSeen(plan, lathe.machine)

    def see(self, snapshot: Snapshot) -> None:
        """Take in a poll of the cut."""
        self._length.see(snapshot)
        if not self._lathe.program.held:  # on its way out the tool is on no path of a turn
            self._path.see(snapshot)

    def problems(self) -> tuple[Problem, ...]:
        """Return everything by which the cut that has ended is not the one that was planned.

        Its turns and its length, then the program with its constants and tables, then the settings; and the path
        that was polled, where somebody has put back what he had changed.

        Raises:
            LinkError: the link broke.
        """
        end = self._lathe.program.end()
        # A program that was ended in mid-turn has not told of its turns any more.
        self.end = end if end.finished else replace(end, turns=self._length.turns)
        early = end_problems(self._plan, self.end, self._length, held=self._lathe.program.held)
        changed = (*early, *self._changed(), *self._lathe.verify())
        return changed or tuple(self._path.problems())

    def _changed(self) -> tuple[Problem, ...]:
        try:
            self._lathe.program.holds(self._plan.program, ended=True)
        except LinkError:
            raise
        except DriverError as changed:
            return tuple(changed.problems)
        return ()
