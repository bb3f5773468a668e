"""What a program will really do, found out before it is sent, by the very rules that execute it.

The program is run with axes that follow exactly; every move is recorded with the times that were asked for and
the times that are used. Findings are facts with numbers; whether they stop a cut is decided elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.pmac.axes import AxisDefinition, axis_positions
from drivers.pmac.execution import Modes, ProgramRun
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.structure import link
from drivers.pmac.program_text import ProgramText
from drivers.pmac.trajectory.linear import Timing
from drivers.pmac.trajectory.pieces import Cubic, Piece, position_at, velocity_at
from drivers.pmac.trajectory.planner import MotionPlanner, MoveRecord
from drivers.pmac.variables import VariableStore

ENDLESS_MOVES = 200_000
"""Moves after which a program is said to have no end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedMove:
    """One move: where it was told to go (counts by motor) and with which times."""

    record: MoveRecord
    pieces: tuple[Piece, ...]

    @property
    def used(self) -> Timing:
        """The times that are used, ms."""
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
) -> CheckedProgram:
    """Run a program from `start` (counts by motor) with ideal axes.

    Raises:
        PmacError: what the controller would refuse; 003 also for a program without an end.
    """
    variables = VariableStore(i_variables)
    for line in text.settings:
        _settle(line, variables)
    ordered = tuple(sorted(definitions, key=lambda definition: definition.motor))
    by_motor = {definition.motor: definition for definition in ordered}
    run = ProgramRun(link(text.program), variables, Modes(), axis_positions(by_motor, start))
    planner = MotionPlanner(run, ordered, variables, tuple(start[d.motor] for d in ordered))
    moves: list[CheckedMove] = []
    pieces: list[Piece] = []
    for _ in range(ENDLESS_MOVES):
        planned = planner.plan()
        pieces.extend(planned.pieces)
        if planned.record is not None:
            moves.append(CheckedMove(record=planned.record, pieces=planned.pieces))
        if planned.finished:
            return _summary(tuple(d.motor for d in ordered), moves, pieces)
    raise PmacError(ErrorCode.DATA_ERROR, f"no end after {ENDLESS_MOVES} moves")


def loop_lines(program: syntax.Program) -> frozenset[int]:
    """Return the lines (counted from 0) that stand inside a WHILE."""
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
    values = [
        position_at(piece.cubics[index], instant)
        for piece in pieces
        for instant in (0.0, piece.duration_ms, *_turning_points(piece.cubics[index], piece.duration_ms))
    ]
    return min(values), max(values)


def _settle(line: syntax.Line, variables: VariableStore) -> None:
    for statement in line:
        if not isinstance(statement, syntax.Assign):
            raise PmacError(ErrorCode.NO_BUFFER_OPEN, "only settings may stand before OPEN PROG")
        index = int(evaluate(statement.target.index, variables))
        variables.set(statement.target.kind, index, evaluate(statement.value, variables))


def _summary(motors: tuple[int, ...], moves: list[CheckedMove], pieces: list[Piece]) -> CheckedProgram:
    peak: dict[int, float] = {}
    lowest: dict[int, float] = {}
    highest: dict[int, float] = {}
    for index, motor in enumerate(motors):
        peak[motor] = max((_peak_velocity(p.cubics[index], p.duration_ms) for p in pieces), default=0.0)
        lowest[motor], highest[motor] = extent(pieces, index) if pieces else (0.0, 0.0)
    return CheckedProgram(
        motors=motors,
        moves=tuple(moves),
        duration_ms=sum(piece.duration_ms for piece in pieces),
        peak_velocity=peak,
        lowest=lowest,
        highest=highest,
    )


def _peak_velocity(cubic: Cubic, duration_ms: float) -> float:
    """Greatest speed of a cubic: at an end, or where the acceleration passes zero."""
    _, _, c2, c3 = cubic
    peak = max(abs(cubic[1]), abs(velocity_at(cubic, duration_ms)))
    if c3:
        instant = -c2 / (3.0 * c3)
        if 0.0 < instant < duration_ms:
            peak = max(peak, abs(velocity_at(cubic, instant)))
    return peak


def _turning_points(cubic: Cubic, duration_ms: float) -> list[float]:
    """Return the instants inside a piece at which the velocity is zero."""
    _, c1, c2, c3 = cubic
    if c3 == 0.0:
        roots = [-c1 / (2.0 * c2)] if c2 else []
    else:
        discriminant = c2 * c2 - 3.0 * c1 * c3
        if discriminant < 0.0:
            return []
        root = discriminant**0.5
        roots = [(-c2 + root) / (3.0 * c3), (-c2 - root) / (3.0 * c3)]
    return [instant for instant in roots if 0.0 < instant < duration_ms]
