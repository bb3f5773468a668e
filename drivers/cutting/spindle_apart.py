"""The motion of a program whose spindle is not its own: it turns evenly, and is put beside the other motors.

Where the spindle is the clock of the program, its times are stretched to what they take at the speed of the cut.
"""

from __future__ import annotations

from drivers.pmac.check import CheckedMove, CheckedProgram
from drivers.pmac.trajectory.linear import Timing
from drivers.pmac.trajectory.pieces import Cubic, Piece, Vector
from drivers.pmac.trajectory.planned import MoveRecord


def with_spindle(
    checked: CheckedProgram, motor: int, counts_per_ms: float, first_counts: float = 0.0, stretch: float = 1.0
) -> CheckedProgram:
    """Return the motion with a spindle that turns at `counts_per_ms` and is at `first_counts` when it begins.

    Every move takes `stretch` times as long as it was programmed to take.
    """
    motors = tuple(sorted((*checked.motors, motor)))
    place = motors.index(motor)
    moves = []
    here = first_counts
    for move in checked.moves:
        pieces = []
        for piece in move.pieces:
            pieces.append(_beside(piece, place, (here, counts_per_ms, 0.0, 0.0), stretch))
            here += counts_per_ms * pieces[-1].duration_ms
        moves.append(CheckedMove(record=_record(move.record, place, here, stretch), pieces=tuple(pieces)))
    peak = {each: speed / stretch for each, speed in checked.peak_velocity.items()}
    return CheckedProgram(
        motors=motors,
        moves=tuple(moves),
        duration_ms=checked.duration_ms * stretch,
        peak_velocity={**peak, motor: abs(counts_per_ms)},
        lowest={**checked.lowest, motor: min(first_counts, here)},
        highest={**checked.highest, motor: max(first_counts, here)},
    )


def _beside(piece: Piece, place: int, turning: Cubic, stretch: float) -> Piece:
    """Return a piece that takes `stretch` times as long, with what the spindle does meanwhile."""
    cubics = piece.cubics
    if stretch != 1.0:
        square, cube = stretch**2, stretch**3
        cubics = tuple([(c0, c1 / stretch, c2 / square, c3 / cube) for c0, c1, c2, c3 in cubics])
    beside = (*cubics[:place], turning, *cubics[place:])
    return Piece(piece.duration_ms * stretch, beside, piece.calculates, piece.real_time, piece.deferred)


def _record(record: MoveRecord, place: int, here: float, stretch: float) -> MoveRecord:
    target: Vector = record.target
    return MoveRecord(
        line=record.line,
        target=(*target[:place], here, *target[place:]),
        asked=_longer(record.asked, stretch),
        timing=None if record.timing is None else _longer(record.timing, stretch),
    )


def _longer(timing: Timing, stretch: float) -> Timing:
    return Timing(ta_ms=timing.ta_ms * stretch, ts_ms=timing.ts_ms * stretch, tm_ms=timing.tm_ms * stretch)
