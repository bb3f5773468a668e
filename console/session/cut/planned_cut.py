"""Comparison of a cut with its plan: before it starts, at each poll while it runs, and after it has ended.

A part is good only where the cut is the planned one. Screens and headless runs share these checks.
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
    """Check that the controller still holds the cut as loaded, before any motion.

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
    """One cut, from start to end. `end` is what its program reported, once it was asked."""

    def __init__(self, lathe: Lathe, plan: CutPlan) -> None:
        self.end: ProgramEnd | None = None
        self.guard = cut_guard(plan, lathe.machine)
        self._lathe, self._plan = lathe, plan
        self._length = CutLength(plan, lathe.machine)
        self._path = PathSeen(plan, lathe.machine)

    def see(self, snapshot: Snapshot) -> None:
        """Take a status poll of the cut."""
        self._length.see(snapshot)
        if not self._lathe.program.held:  # while retracting, the tool is on no path of a turn
            self._path.see(snapshot)

    def problems(self) -> tuple[Problem, ...]:
        """Return every difference between the finished cut and its plan.

        Compared are turns and length, the program with its constants and tables, the settings, and the polled
        path, which shows a change that somebody has reverted.

        Raises:
            LinkError: the link broke.
        """
        end = self._lathe.program.end()
        # A program that was ended in mid-turn no longer reports its turns.
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
