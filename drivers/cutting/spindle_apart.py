"""The motion of a program whose spindle is not its own: it turns evenly, and is put beside the other motors.

Where the spindle is the clock of the program, its times are stretched to what they take at the speed of the cut.
"""

from __future__ import annotations

from dataclasses import replace

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
            slower = _stretched(piece, stretch)
            turning: Cubic = (here, counts_per_ms, 0.0, 0.0)
            pieces.append(replace(slower, cubics=(*slower.cubics[:place], turning, *slower.cubics[place:])))
            here += counts_per_ms * slower.duration_ms
        moves.append(CheckedMove(record=_record(move, place, here, stretch), pieces=tuple(pieces)))
    peak = {each: speed / stretch for each, speed in checked.peak_velocity.items()}
    return CheckedProgram(
        motors=motors,
        moves=tuple(moves),
        duration_ms=checked.duration_ms * stretch,
        peak_velocity={**peak, motor: abs(counts_per_ms)},
        lowest={**checked.lowest, motor: min(first_counts, here)},
        highest={**checked.highest, motor: max(first_counts, here)},
    )


def _stretched(piece: Piece, stretch: float) -> Piece:
    cubics = tuple((c0, c1 / stretch, c2 / stretch**2, c3 / stretch**3) for c0, c1, c2, c3 in piece.cubics)
    return replace(piece, duration_ms=piece.duration_ms * stretch, cubics=cubics)


def _record(move: CheckedMove, place: int, here: float, stretch: float) -> MoveRecord:
    target: Vector = move.record.target
    timing = move.record.timing
    return replace(
        move.record,
        target=(*target[:place], here, *target[place:]),
        asked=_longer(move.record.asked, stretch),
        timing=None if timing is None else _longer(timing, stretch),
    )


def _longer(timing: Timing, stretch: float) -> Timing:
    return Timing(ta_ms=timing.ta_ms * stretch, ts_ms=timing.ts_ms * stretch, tm_ms=timing.tm_ms * stretch)
