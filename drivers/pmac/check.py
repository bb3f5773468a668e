"""Predict the motion of a program before it is sent, by the very rules that execute it.

The program is run with axes that follow exactly; every move is recorded with its programmed and its actual times.
Findings are facts with numbers; whether they block a cut is decided elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.pmac.analysis.walk import WalkEnding, walk
from drivers.pmac.axes import AxisDefinition
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, NoResultError, PmacError
from drivers.pmac.program_text import ProgramText
from drivers.pmac.trajectory.cubics import motion_of
from drivers.pmac.trajectory.linear import Timing
from drivers.pmac.trajectory.pieces import Piece
from drivers.pmac.trajectory.planned_pieces import MoveRecord

ENDLESS_MOVES = 200_000  # Number of moves after which a program counts as endless


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedMove:
    """One move: its target (counts by motor) and its times."""

    record: MoveRecord
    pieces: tuple[Piece, ...]

    @property
    def used_times(self) -> Timing:
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
    if walked.substitutes:
        raise NoResultError(ErrorCode.DATA_ERROR, walked.substitutes[0].detail)
    if walked.ending is not WalkEnding.FINISHED:
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


def _summary(motors: tuple[int, ...], moves: list[CheckedMove], pieces: list[Piece]) -> CheckedProgram:
    motions = {motor: motion_of(pieces, index) for index, motor in enumerate(motors)}
    extents = {motor: motion.extent() for motor, motion in motions.items()}
    return CheckedProgram(
        motors=motors,
        moves=tuple(moves),
        duration_ms=sum(piece.duration_ms for piece in pieces),
        peak_velocity={motor: motion.peak_velocity() for motor, motion in motions.items()},
        lowest={motor: low for motor, (low, _) in extents.items()},
        highest={motor: high for motor, (_, high) in extents.items()},
    )
