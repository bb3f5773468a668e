"""Find the zig-zag: a motor moved to and fro by the same distance, and the stroke that blending leaves."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.pmac.analysis.moves import MoveAnalysis
from drivers.pmac.analysis.step import SAME_COUNTS
from drivers.pmac.analysis.subject import Subject

FEWEST_MOVES = 4
"""Least number of moves to and fro that make a zig-zag."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZigZag:
    """A steady zig-zag of the motor at place `index`; `move` is one of its moves, far from its start and end.

    `begins_at` is the programmed point (counts) from which it starts.
    """

    index: int
    moves: tuple[MoveAnalysis, ...]
    move: MoveAnalysis
    begins_at: float

    @property
    def stroke(self) -> float:
        """The commanded stroke, counts."""
        return abs(self.move.motors[self.index].commanded)

    @property
    def made(self) -> float:
        """The actual stroke, counts."""
        return abs(self.move.motors[self.index].made)

    @property
    def kept(self) -> float:
        """The fraction of the stroke that is made."""
        return self.made / self.stroke


def find_zigzag(subject: Subject) -> ZigZag | None:
    """Return the longest zig-zag of a program, that of the tool first."""
    indices = [index for index in (subject.tool, *range(len(subject.walk.motors))) if index is not None]
    for index in dict.fromkeys(indices):
        runs = _runs(subject, index)
        longest = max(runs, key=len, default=())
        if len(longest) >= FEWEST_MOVES:
            first = longest[0].motors[index]
            return ZigZag(
                index=index,
                moves=longest,
                move=longest[len(longest) // 2],
                begins_at=first.target - first.commanded,
            )
    return None


def _runs(subject: Subject, index: int) -> list[tuple[MoveAnalysis, ...]]:
    """Return the stretches of LINEAR moves in which each reverses the one before it."""
    runs: list[list[MoveAnalysis]] = [[]]
    for move in subject.moves:
        run = runs[-1]
        if run and not (run[-1].blended and _takes_back(run[-1], move, index)):
            runs.append(run := [])
        if move.mode == "LINEAR":
            run.append(move)
    return [tuple(run) for run in runs]


def _takes_back(before: MoveAnalysis, move: MoveAnalysis, index: int) -> bool:
    there, back = before.motors[index].commanded, move.motors[index].commanded
    return abs(there) > SAME_COUNTS and abs(there + back) <= 1e-6 * abs(there)
