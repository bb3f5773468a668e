"""Predict the motion of a program before it is sent, by the very rules that execute it.

The program is run with axes that follow exactly; every move is recorded with its programmed and its actual times.
Findings are facts with numbers; whether they block a cut is decided elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.pmac.analysis.walk import Ending, walk
from drivers.pmac.axes import AxisDefinition
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.program_text import ProgramText
from drivers.pmac.trajectory.linear import Timing
from drivers.pmac.trajectory.pieces import Piece, motion_of
from drivers.pmac.trajectory.planned import MoveRecord

ENDLESS_MOVES = 200_000
"""Number of moves after which a program counts as endless."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedMove:
    """One move: its target (counts by motor) and its times."""

    record: MoveRecord
    pieces: tuple[Piece, ...]

    @property
    def used(self) -> Timing:
        """The times that are actually used, ms."""
        return self.record.timing or self.record.asked


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedProgram:
    """The whole motion of a program; `motors` gives the order of every vector."""

    motors: tuple[int, ...]
    moves: tuple[CheckedMove, ...]
    duration_ms: float
    peak_velocity: Mapping[int, float]
    lowest: Mapping[int, float]
    highest: Mapping[int, float]


def run_through(
    text: ProgramText,
    i_variables: Mapping[int, float],
    definitions: Sequence[AxisDefinition],
    start: Mapping[int, float],
    dialect: Dialect = PMAC,
) -> CheckedProgram:
    """Run a program from `start` (counts by motor) with ideal axes.

    Compensation tables are not included, and time runs on the controller's own time base.

    Raises PmacError: what the controller would refuse; 003 also for a program without an end.
    """
    walked = walk(text, i_variables, definitions, start, dialect=dialect, most_steps=ENDLESS_MOVES, watched=False)
    if walked.error is not None:
        raise walked.error
    if walked.ending is not Ending.FINISHED:
        raise PmacError(ErrorCode.DATA_ERROR, f"no end after {len(walked.steps)} moves")
    moves = [
        CheckedMove(record=step.planned.record, pieces=step.planned.pieces)
        for step in walked.steps
        if step.planned.record is not None
    ]
    return _summary(walked.motors, moves, walked.pieces)


def loop_lines(program: syntax.Program) -> frozenset[int]:
    """Return the lines (counted from 0) that are inside a WHILE."""
    inside: set[int] = set()
    depth = 0
    for number, line in enumerate(program):
        for statement in line:
            if isinstance(statement, syntax.While):
                depth += 1
            elif isinstance(statement, syntax.EndWhile):
                depth -= 1
        if depth > 0:
            inside.add(number)
    return frozenset(inside)


def extent(pieces: Sequence[Piece], index: int) -> tuple[float, float]:
    """Return the lowest and highest position of one motor over some pieces, counts."""
    return motion_of(pieces, index).extent()


def peak_velocity(pieces: Sequence[Piece], index: int) -> float:
    """Return the greatest speed of one motor over some pieces, counts/ms."""
    return motion_of(pieces, index).peak_velocity() if pieces else 0.0


def _summary(motors: tuple[int, ...], moves: list[CheckedMove], pieces: list[Piece]) -> CheckedProgram:
    peak: dict[int, float] = {}
    lowest: dict[int, float] = {}
    highest: dict[int, float] = {}
    for index, motor in enumerate(motors):
        peak[motor] = peak_velocity(pieces, index)
        lowest[motor], highest[motor] = extent(pieces, index) if pieces else (0.0, 0.0)
    return CheckedProgram(
        motors=motors,
        moves=tuple(moves),
        duration_ms=sum(piece.duration_ms for piece in pieces),
        peak_velocity=peak,
        lowest=lowest,
        highest=highest,
    )
