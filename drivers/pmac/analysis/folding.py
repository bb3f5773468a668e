"""Fold repeating moves: a stretch of some moves and the number of its repetitions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.pmac.analysis.moves import MoveAnalysis

LONGEST_PATTERN = 48  # Length of the longest stretch that is searched for, in moves

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
    labels, numbers = _described(one)
    other_labels, other_numbers = _described(other)
    return labels == other_labels and all(
        math.isclose(a, b, rel_tol=_SAME, abs_tol=_SAME) for a, b in zip(numbers, other_numbers, strict=True)
    )


def _described(move: MoveAnalysis) -> tuple[tuple[object, ...], list[float]]:
    """Return what must be equal of two like moves, and what must be close."""
    peaks = [motor.peaks for motor in move.motors]
    numbers = [ms for timing in (move.asked, move.used) for ms in (timing.ta_ms, timing.ts_ms, timing.tm_ms)]
    for motor, peak in zip(move.motors, peaks, strict=True):
        numbers += (motor.commanded, motor.made, peak.velocity, peak.acceleration, peak.jerk or 0.0)
    jumps = tuple(peak.jerk is None for peak in peaks)
    return (move.program, move.line, move.mode, move.blended, jumps), numbers
