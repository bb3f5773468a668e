"""A planner's output: the pieces of one planning step, and the outcome of the request."""

from __future__ import annotations

from typing import NamedTuple

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.requests import CircleRequest, DeferredValue, Halt, HomeRequest, PresetRequest, TriggerRequest
from drivers.pmac.trajectory.linear import Timing, timing_of
from drivers.pmac.trajectory.pieces import Piece, Vector

# What the owner of the motors has to carry out between two moves.
Event = HomeRequest | TriggerRequest | PresetRequest | Halt


class MoveRecord(NamedTuple):
    """A requested move and its actual timing; `timing` is None for moves that are done as requested.

    `asked` of a RAPID move is the time of its slowest motor, before acceleration is added.
    """

    line: int
    target: Vector
    asked: Timing
    timing: Timing | None


class PlannedPieces(NamedTuple):
    """The pieces from one planning step; `finished` when nothing follows them.

    An `event` is carried out when the pieces have been played; then `MotionPlanner.relocate` and
    `ProgramRun.relocate` set the new positions, and the program continues.
    """

    pieces: tuple[Piece, ...]
    record: MoveRecord | None = None
    finished: bool = False
    event: Event | None = None


def plain_record(line: int, target: Vector, tm_ms: float) -> MoveRecord:
    """Return the record of a move that is done in the requested time."""
    return MoveRecord(line, target, timing_of(0.0, 0.0, tm_ms), None)


def defer(pieces: tuple[Piece, ...], deferred: tuple[DeferredValue, ...]) -> tuple[Piece, ...]:
    """Attach assignments to the piece with which a move begins: the ramp into it, or else the first."""
    if not deferred:
        return pieces
    begin = next((k for k, piece in enumerate(pieces) if piece.calculates), 0)
    return (*pieces[:begin], pieces[begin]._replace(deferred=deferred), *pieces[begin + 1 :])


def circle_time_ms(request: CircleRequest, length: float) -> float:
    """Return the time of a circle move: as programmed, or its length (user units) over its speed.

    Raises PmacError: 003, no speed.
    """
    if request.tm_ms is not None:
        return request.tm_ms
    if not request.speed_per_ms > 0.0:
        raise PmacError(ErrorCode.DATA_ERROR, f"a circle move at {request.speed_per_ms:g} units a ms; above 0")
    return length / request.speed_per_ms


def check_segment(duration_ms: float) -> None:
    """Refuse a PVT or SPLINE segment without a time. Raises PmacError: 003, no time."""
    if not duration_ms > 0.0:
        raise PmacError(ErrorCode.DATA_ERROR, f"a segment of {duration_ms:g} ms; above 0")
