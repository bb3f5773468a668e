"""Limit the controller time of one host: per turn, and until the next background cycle.

Work is counted in values: one read or set, or one line of data, is about a microsecond.
"""

from __future__ import annotations

from drivers.simulator.card.controller import Controller

LINES_PER_TURN = 4
"""Maximum lines of one host per turn: none can block the controller for the others."""

WORK_PER_TURN = 2560
"""Values after which no further command of that host is begun in the same turn, nor while it owes as many."""

LINES_PER_CYCLE = 64
"""Maximum lines of one host before the next background cycle, however often it has a turn."""

WORK_PER_CYCLE = 1024
"""Values credited to one host per background cycle, about a quarter of its real time; the rest is owed."""


class Share:
    """The work done for one host."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._cycle = controller.cycles
        self._lines = self._owed = 0
        self._turn_lines = self._turn_work = 0
        self.heavy = False

    @property
    def turn_over(self) -> bool:
        """Whether the host has used up its share of this turn."""
        return self._turn_lines >= LINES_PER_TURN or self._turn_work >= WORK_PER_TURN

    @property
    def work_over(self) -> bool:
        """Whether its work share of this turn is used up: not even the next command of a line is begun."""
        return self._turn_work >= WORK_PER_TURN

    @property
    def cycle_over(self) -> bool:
        """Whether it has used up its share of this background cycle."""
        return self._lines >= LINES_PER_CYCLE or self._owed >= WORK_PER_TURN

    def follow(self) -> None:
        """Record a background cycle; to be called in each of them."""
        if self._cycle != self._controller.cycles:
            self._cycle = self._controller.cycles
            self._lines = 0
            self._owed = max(0, self._owed - WORK_PER_CYCLE)

    def spend(self, work: int, lines: int = 0) -> None:
        """Record work done for the host."""
        self._owed += work
        self._lines += lines
        self._turn_work += work
        self._turn_lines += lines

    def end_turn(self) -> None:
        """Reset; `heavy` is whether this turn was a long one."""
        self.heavy = self._turn_work >= WORK_PER_TURN
        self._turn_lines = self._turn_work = 0
