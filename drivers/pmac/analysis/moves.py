"""Every move of a walk, as commanded and as actually made. Positions are counts, times ms.

A blended move does not reach its programmed point. The point reached is where the motor reverses, if it does so at
the end of the move; otherwise its position at the nominal end. A move that is not blended into another reaches its
point.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from drivers.pmac.analysis.timeline import SAME_COUNTS, Peaks, ProgramStep, Timeline
from drivers.pmac.analysis.walk import Walk
from drivers.pmac.requests import CircleRequest, LinearRequest, PvtRequest, RapidRequest, Request, SplineRequest
from drivers.pmac.trajectory.linear import Timing
from drivers.pmac.trajectory.planned_pieces import MoveRecord

LONGEST_PATTERN = 48  # Length of the longest stretch that is searched for, in moves

_SAME = 1e-6

RAMPED = ("LINEAR", "CIRCLE")  # Modes whose moves are blended by ramps of TA and TS
_TOUCHING_MS = 1e-6  # Two moves touch when one begins where the other nominally ends, within rounding

_MODES: Mapping[type[Request], str] = {
    LinearRequest: "LINEAR",
    RapidRequest: "RAPID",
    SplineRequest: "SPLINE",
    CircleRequest: "CIRCLE",
    PvtRequest: "PVT",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorMove:
    """One motor in one move, counts: `commanded` between programmed points, `made` between points reached.

    `turns`: it reverses at the end of the move.
    """

    motor: int
    target: float
    commanded: float
    reached: float
    made: float
    turns: bool
    peaks: Peaks

    @property
    def lost(self) -> float:
        """The distance by which the motion was shorter than commanded; below 0 it was longer."""
        return abs(self.commanded) - abs(self.made)


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveAnalysis:
    """One move, from its nominal beginning to its nominal end; `motors` in the order of the walk.

    `number` counts the moves, `step` is its place in the walk, `line` that in the program, both from 0. `mode` is
    LINEAR, RAPID, SPLINE, PVT or CIRCLE. TA and TS of `asked` and `used` are 0 where the mode has none.
    """

    number: int
    step: int
    program: int
    line: int
    mode: str
    by_move_time: bool
    asked: Timing
    used: Timing
    begins_ms: float
    ends_ms: float
    blended: bool
    motors: tuple[MotorMove, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Nominal:
    """Position of a move in time; the change into it takes `ramp_ms`, centred on its beginning.

    `follows`: the previous move blends into it.
    """

    place: int
    step: ProgramStep
    record: MoveRecord
    mode: str
    used: Timing
    begins_ms: float
    ends_ms: float
    ramp_ms: float
    follows: bool

    @property
    def starts_ms(self) -> float:
        """Start of its first motion."""
        if self.mode == "SPLINE" and not self.follows:
            # The zero-distance segment before a spline moves, too.
            return self.begins_ms - self.used.tm_ms
        return self.begins_ms - 0.5 * self.ramp_ms

    def analysis(self, number: int, blended: bool, motors: tuple[MotorMove, ...]) -> MoveAnalysis:
        return MoveAnalysis(
            number=number,
            step=self.place,
            program=self.step.program,
            line=self.record.line,
            mode=self.mode,
            by_move_time=self.step.by_move_time,
            asked=self.record.asked,
            used=self.used,
            begins_ms=self.begins_ms,
            ends_ms=self.ends_ms,
            blended=blended,
            motors=motors,
        )


def analyse_moves(walk: Walk, timeline: Timeline) -> tuple[MoveAnalysis, ...]:
    """Return the analysis of every move of a walk."""
    nominal = _nominal(walk)
    followers: list[_Nominal | None] = [*nominal[1:], None][: len(nominal)]
    moves: list[MoveAnalysis] = []
    before = came_from = walk.start
    for move, after in zip(nominal, followers, strict=True):
        if not move.follows:
            # From rest: at the last target, or where an event put the motors.
            rest = walk.steps[move.place - 1] if move.place else None
            before = came_from = rest.at if rest is not None and rest.planned.record is None else before
        following = after if after is not None and after.follows else None
        ends = _ends(timeline, move, following)
        reached = tuple(place for place, _ in ends)
        begins_ms = move.begins_ms if move.follows else move.starts_ms
        ends_ms = move.ends_ms if following else (after.starts_ms if after else timeline.ends_ms)
        target = move.record.target
        motors = tuple(
            MotorMove(
                motor=motor,
                target=target[index],
                commanded=target[index] - before[index],
                reached=reached[index],
                made=reached[index] - came_from[index],
                turns=ends[index][1],
                peaks=timeline.peaks(index, begins_ms, ends_ms),
            )
            for index, motor in enumerate(walk.motors)
        )
        moves.append(move.analysis(len(moves), following is not None, motors))
        before, came_from = target, reached
    return tuple(moves)


def _nominal(walk: Walk) -> list[_Nominal]:
    nominal: list[_Nominal] = []
    for place, step in enumerate(walk.steps):
        if step.planned.record is not None:
            before = nominal[-1] if nominal and nominal[-1].place == place - 1 else None
            nominal.append(_time_move(place, step, step.planned.record, before))
    return nominal


def _time_move(place: int, step: ProgramStep, record: MoveRecord, before: _Nominal | None) -> _Nominal:
    """Return the timing of a move; `before` is the previous move, when nothing separates them."""
    mode, used = _MODES[type(step.request)], record.timing or record.asked
    ramp_ms = used.ta_ms if mode in RAMPED else 0.0
    if mode in RAMPED:
        begins_ms = step.ramp_begins_ms() + 0.5 * ramp_ms
    elif mode == "SPLINE":
        # A segment is planned when the next point is known: the motion of this step ends where its own begins.
        begins_ms = step.ends_ms
    elif mode == "RAPID":
        begins_ms = _jog_begins_ms(step)
        used = replace(used, tm_ms=step.ends_ms - begins_ms)
    else:
        begins_ms = step.ends_ms - used.tm_ms
    follows = before is not None and _blends(before, mode, begins_ms)
    if before is not None and follows:
        begins_ms = before.ends_ms
    return _Nominal(
        place=place,
        step=step,
        record=record,
        mode=mode,
        used=used,
        begins_ms=begins_ms,
        ends_ms=begins_ms + used.tm_ms,
        ramp_ms=ramp_ms,
        follows=follows,
    )


def _blends(before: _Nominal, mode: str, begins_ms: float) -> bool:
    """Return whether a move continues without a stop: of the same kind, and beginning where the other ends."""
    alike = before.mode == mode != "RAPID" or (before.mode in RAMPED and mode in RAMPED)
    # With Ix92 the previous move's step includes its stop, too.
    stopped = before.mode in RAMPED and before.step.ends_ms > before.ends_ms + _TOUCHING_MS
    return alike and not stopped and abs(begins_ms - before.ends_ms) < _TOUCHING_MS


def _jog_begins_ms(step: ProgramStep) -> float:
    """Return when the jog of a RAPID step begins: at its last rest, after the end of the previous motion."""
    instant = step.ends_ms
    for piece in reversed(step.planned.pieces):
        instant -= piece.duration_ms
        if not any(cubic[1] for cubic in piece.cubics):
            return instant
    return step.begins_ms


def _ends(timeline: Timeline, move: _Nominal, after: _Nominal | None) -> list[tuple[float, bool]]:
    """Return the point that each motor reaches, and whether it reverses there; `after` blends out of the move."""
    if after is None:
        return [(target, False) for target in move.record.target]
    half_ms = 0.5 * (after.ramp_ms or min(move.used.tm_ms, after.used.tm_ms))
    begin_ms, end_ms = move.ends_ms - half_ms, move.ends_ms + half_ms
    ends = []
    for index in range(len(move.record.target)):
        arriving, leaving = timeline.velocity(index, begin_ms), timeline.velocity(index, end_ms)
        # A motor at rest still has a velocity of rounding errors.
        turns = arriving * leaving < 0.0 and min(abs(arriving), abs(leaving)) * half_ms > SAME_COUNTS
        lowest, highest = timeline.extent(index, begin_ms, end_ms) if turns else (0.0, 0.0)
        reached = highest if arriving > 0.0 else lowest
        ends.append((reached if turns else timeline.position(index, move.ends_ms), turns))
    return ends


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
        if not _is_same_move(moves[place], moves[place + length]):
            continue
        end = place + length
        while end < len(moves) and _is_same_move(moves[end], moves[end - length]):
            end += 1
        times = (end - place) // length
        if times > 1 and length * times > best[0] * best[1]:
            best = (length, times)
    return best


def _is_same_move(one: MoveAnalysis, other: MoveAnalysis) -> bool:
    """Return whether two moves are the same except for their start."""
    labels, numbers = _describe_move(one)
    other_labels, other_numbers = _describe_move(other)
    return labels == other_labels and all(
        math.isclose(a, b, rel_tol=_SAME, abs_tol=_SAME) for a, b in zip(numbers, other_numbers, strict=True)
    )


def _describe_move(move: MoveAnalysis) -> tuple[tuple[object, ...], list[float]]:
    """Return what must be equal of two like moves, and what must be close."""
    peaks = [motor.peaks for motor in move.motors]
    numbers = [ms for timing in (move.asked, move.used) for ms in (timing.ta_ms, timing.ts_ms, timing.tm_ms)]
    for motor, peak in zip(move.motors, peaks, strict=True):
        numbers += (motor.commanded, motor.made, peak.velocity, peak.acceleration, peak.jerk or 0.0)
    jumps = tuple(peak.jerk is None for peak in peaks)
    return (move.program, move.line, move.mode, move.blended, jumps), numbers
