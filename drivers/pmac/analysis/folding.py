"""Fold repeating moves: a stretch of some moves and the number of its repetitions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis
from drivers.pmac.analysis.timeline import Peaks

LONGEST_PATTERN = 48
"""Length of the longest stretch that is searched for, in moves."""

_SAME = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Fold:
    """Moves repeated `times` times in a row; those given are the last repetition."""

    moves: tuple[MoveAnalysis, ...]
    times: int


def fold(moves: Sequence[MoveAnalysis]) -> tuple[Fold, ...]:
    """Fold the moves: at each place the pattern that covers the most moves, the shortest of these."""
    folds: list[Fold] = []
    place = 0
    while place < len(moves):
        length, times = _best(moves, place)
        end = place + length * times
        folds.append(Fold(moves=tuple(moves[end - length : end]), times=times))
        place = end
    return tuple(folds)


def _best(moves: Sequence[MoveAnalysis], place: int) -> tuple[int, int]:
    best = (1, 1)
    for length in range(1, min(LONGEST_PATTERN, (len(moves) - place) // 2) + 1):
        if not _alike(moves[place], moves[place + length]):
            continue
        end = place + length
        while end < len(moves) and _alike(moves[end], moves[end - length]):
            end += 1
        times = (end - place) // length
        if times > 1 and length * times > best[0] * best[1]:
            best = (length, times)
    return best


def _alike(one: MoveAnalysis, other: MoveAnalysis) -> bool:
    """Return whether two moves are the same except for their start."""
    if (one.program, one.line, one.mode, one.blended) != (other.program, other.line, other.mode, other.blended):
        return False
    times = [(t.ta_ms, t.ts_ms, t.tm_ms) for move in (one, other) for t in (move.asked, move.used)]
    if not all(map(_close, times[0] + times[1], times[2] + times[3])):
        return False
    return all(map(_alike_motors, one.motors, other.motors))


def _alike_motors(one: MotorMove, other: MotorMove) -> bool:
    return (
        _close(one.commanded, other.commanded)
        and _close(one.made, other.made)
        and _alike_peaks(one.peaks, other.peaks)
    )


def _alike_peaks(one: Peaks, other: Peaks) -> bool:
    if (one.jerk is None) is not (other.jerk is None):
        return False
    pairs = [(one.velocity, other.velocity), (one.acceleration, other.acceleration)]
    return all(_close(a, b) for a, b in [*pairs, (one.jerk or 0.0, other.jerk or 0.0)])


def _close(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=_SAME, abs_tol=_SAME)
