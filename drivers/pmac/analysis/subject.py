"""The subject of the findings: a walked program with its moves, on a machine whose motors have roles."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

from drivers.pmac.analysis.moves import MoveAnalysis
from drivers.pmac.analysis.timeline import SAME_COUNTS, Timeline
from drivers.pmac.analysis.walk import Walk
from profiles.machine import MachineProfile

FEWEST_TOOL_MOVES = 2  # Tool moves, with the spindle turning, that make a cut


@dataclass(frozen=True, kw_only=True)
class Subject:
    """All inputs of a rule. `place_of` returns the line of the file (from 1) of a line of a program."""

    machine: MachineProfile
    walk: Walk
    timeline: Timeline
    moves: tuple[MoveAnalysis, ...]
    place_of: Callable[[int, int], int]

    @property
    def tool(self) -> int | None:
        """The place of the tool's motor in every vector; None when it has no axis."""
        return self._index(self.machine.tool.motor)

    @property
    def spindle(self) -> int | None:
        """The place of the spindle's motor."""
        return self._index(self.machine.spindle.motor)

    @property
    def carriage(self) -> int | None:
        """The place of the carriage's motor."""
        return self._index(self.machine.carriage.motor)

    @cached_property
    def cut(self) -> tuple[MoveAnalysis, ...]:
        """The longest stretch of moves in which tool and spindle move together; empty without one.

        It begins and ends with a move of the tool; the spindle is commanded to turn in every one of its moves.
        """
        tool, spindle = self.tool, self.spindle
        if tool is None or spindle is None:
            return ()
        stretches: list[list[MoveAnalysis]] = [[]]
        for move in self.moves:
            if moves(move, spindle):
                stretches[-1].append(move)
            elif stretches[-1]:
                stretches.append([])
        cuts: list[list[MoveAnalysis]] = [[]]
        for stretch in stretches:
            places = [place for place, move in enumerate(stretch) if moves(move, tool)]
            if len(places) >= FEWEST_TOOL_MOVES:
                cuts.append(stretch[places[0] : places[-1] + 1])
        longest = max(cuts, key=len)
        return tuple(longest)

    def lines(self, moves: Iterable[MoveAnalysis]) -> tuple[int, ...]:
        """Return the lines of the file that some moves come from, in order, each once."""
        return tuple(sorted({self.place_of(move.program, move.line) for move in moves}))

    def um(self, counts: float) -> float:
        """Return a tool distance in um."""
        return counts * self.machine.tool.count_um

    def rpm(self, counts_per_ms: float) -> float:
        """Return a spindle speed in revolutions per minute."""
        return 60_000.0 * counts_per_ms / self.machine.spindle.counts_per_rev

    def setting(self, motor: int, number: int) -> float:
        """Return Ix`number` of a motor as it is at the end of the program."""
        return self.walk.variables.motor(motor, number)

    def _index(self, motor: int) -> int | None:
        return self.walk.motors.index(motor) if motor in self.walk.motors else None


def moves(move: MoveAnalysis, index: int) -> bool:
    """Return whether a move commands a displacement of a motor."""
    return abs(move.motors[index].commanded) > SAME_COUNTS
