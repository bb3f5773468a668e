"""Explain why a zig-zag does not reach its stroke, in sentences derived from the computed numbers.

The lobe to be removed is assumed to be a sine of exactly the commanded stroke, in phase with the path.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.pmac.analysis.findings import (
    ExplanationSentence,
    FindingCode,
    ProgramFinding,
    Sentence,
    Subject,
    Value,
    finding,
    sentence,
)
from drivers.pmac.analysis.moves import RAMPED, MoveAnalysis
from drivers.pmac.analysis.timeline import SAME_COUNTS
from drivers.pmac.analysis.units import shown_length
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.syntax import Set
from drivers.pmac.program_text import ProgramText
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.trajectory.linear import Limits, LinearMove, Timing, effective_timing
from profiles.axis.servo import sampled_response

KEPT_ENOUGH = 0.98  # A stroke that keeps this fraction does not count as lost
FEWEST_MOVES = 4  # Least number of moves to and fro that make a zig-zag
TARGET_FRACTION = 0.95  # The fraction of the stroke for which times are searched

_WORTH_SAYING = 0.01
_SAMPLES = 720


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
    def made_stroke(self) -> float:
        """The actual stroke, counts."""
        return abs(self.move.motors[self.index].made)

    @property
    def kept_fraction(self) -> float:
        """The fraction of the stroke that is made."""
        return self.made_stroke / self.stroke


def find_zigzag(subject: Subject) -> ZigZag | None:
    """Return the longest zig-zag of a program, that of the tool first."""
    indices = [index for index in (subject.tool, *range(len(subject.walk.motors))) if index is not None]
    for index in dict.fromkeys(indices):
        longest = max(_runs(subject, index), key=len)
        if len(longest) >= FEWEST_MOVES:
            first, middle = longest[0].motors[index], longest[len(longest) // 2]
            begins_at = first.target - first.commanded
            return ZigZag(index=index, moves=tuple(longest), move=middle, begins_at=begins_at)
    return None


def _runs(subject: Subject, index: int) -> list[list[MoveAnalysis]]:
    """Return the stretches of LINEAR moves in which each reverses the one before it."""
    runs: list[list[MoveAnalysis]] = [[]]
    for move in subject.moves:
        run = runs[-1]
        there, back = (each.motors[index].commanded for each in (run[-1] if run else move, move))
        reverses = abs(there) > SAME_COUNTS and abs(there + back) <= 1e-6 * abs(there)
        if run and not (run[-1].blended and reverses):
            runs.append(run := [])
        if move.mode == "LINEAR":
            run.append(move)
    return runs


def explain(subject: Subject, zigzag: ZigZag | None) -> tuple[Sentence, ...]:
    """Return the explanation of a zig-zag that loses stroke or time; empty if there is nothing to explain."""
    if zigzag is None:
        return ()
    stretched = zigzag.move.used.tm_ms > zigzag.move.asked.tm_ms * (1.0 + 1e-9)
    if zigzag.kept_fraction >= KEPT_ENOUGH and not stretched:
        return ()
    tm_ms = zigzag.move.asked.tm_ms
    stroke, made = _length(subject, zigzag, zigzag.stroke), _length(subject, zigzag, zigzag.made_stroke)
    if _believable(subject, zigzag):
        sentences = [sentence(ExplanationSentence.TOLD, **stroke, tm_ms=tm_ms, hz=500.0 / tm_ms)]
    else:
        sentences = [sentence(ExplanationSentence.TOLD_WITHOUT_TIME, **stroke, tm_ms=tm_ms)]
    sentences += _times(subject, zigzag, stretched)
    made_lengths = {f"made_{key}": value for key, value in made.items()}
    sentences.append(
        sentence(ExplanationSentence.STROKE_MADE, **stroke, **made_lengths, percent=100.0 * zigzag.kept_fraction)
    )
    if zigzag.index == subject.tool:
        sentences += _explain_residual(subject, zigzag)
    return (*sentences, *_advice(subject, zigzag, stretched))


def _times(subject: Subject, zigzag: ZigZag, stretched: bool) -> list[Sentence]:
    asked, used = zigzag.move.asked, zigzag.move.used
    sentences = [
        sentence(ExplanationSentence.ACCELERATION_TIME, ta_ms=asked.ta_ms, ts_ms=asked.ts_ms, used_ms=used.ta_ms)
    ]
    if not stretched:
        return sentences
    hz = 500.0 / used.tm_ms
    sentences.append(sentence(ExplanationSentence.MOVE_STRETCHED, asked_ms=asked.tm_ms, used_ms=used.tm_ms, hz=hz))
    spindle = subject.spindle
    way = zigzag.move.motors[spindle].commanded if spindle is not None and spindle != zigzag.index else 0.0
    if not way:
        return sentences
    rpm = subject.rpm(way / used.tm_ms)
    if not _believable(subject, zigzag):
        return [*sentences, sentence(ExplanationSentence.SPEED_MADE, hz=hz, rpm=rpm)]
    slowed = sentence(
        ExplanationSentence.SLOWED_DOWN,
        hz=hz,
        rpm=rpm,
        asked_hz=500.0 / asked.tm_ms,
        asked_rpm=subject.rpm(way / asked.tm_ms),
        times=used.tm_ms / asked.tm_ms,
    )
    return [*sentences, slowed]


def _explain_residual(subject: Subject, zigzag: ZigZag) -> list[Sentence]:
    """State the residual on a part whose lobe is the commanded stroke: by the path alone, then with the servo."""
    stroke_um, hz = subject.um(zigzag.stroke), 500.0 / zigzag.move.used.tm_ms
    lost_um = stroke_um - subject.um(zigzag.made_stroke)
    percent = 100.0 * lost_um / stroke_um
    response = complex(sampled_response(subject.machine, hz))
    left = abs(1.0 - _fundamental(subject, zigzag) * response)
    servo = sentence(
        ExplanationSentence.LEFT_WITH_THE_SERVO,
        hz=hz,
        gain=abs(response),
        late_deg=-math.degrees(cmath.phase(response)),
        left_um=left * stroke_um,
        stroke_um=stroke_um,
        percent=100.0 * left,
    )
    return [
        sentence(ExplanationSentence.LEFT_BY_BLENDING, left_um=lost_um, stroke_um=stroke_um, percent=percent),
        servo,
    ]


def _fundamental(subject: Subject, zigzag: ZigZag) -> float:
    """Return the fundamental of the actual path, as a fraction of a sine with the commanded stroke."""
    period_ms = 2.0 * zigzag.move.used.tm_ms
    total = 0j
    for sample in range(_SAMPLES):
        fraction = sample / _SAMPLES
        place = subject.timeline.position(zigzag.index, zigzag.move.begins_ms + fraction * period_ms)
        total += place * cmath.exp(-2j * math.pi * fraction)
    return 4.0 * abs(total) / _SAMPLES / zigzag.stroke


def _advice(subject: Subject, zigzag: ZigZag, stretched: bool) -> list[Sentence]:
    believable = _believable(subject, zigzag)
    tm_ms = zigzag.move.asked.tm_ms if believable else zigzag.move.used.tm_ms
    sentences = []
    if stretched and believable:
        ta_ms, ts_ms = math.floor(tm_ms), math.floor(0.5 * tm_ms)
        sentences.append(sentence(ExplanationSentence.TIMES_FOR_THE_SPEED, tm_ms=tm_ms, ta_ms=ta_ms, ts_ms=ts_ms))
    best = _best_times(subject, zigzag, tm_ms)
    if best is not None:
        percent = 100.0 * (1.0 - best.ta_ms / (2.0 * tm_ms))
        times = {"ta_ms": best.ta_ms, "ts_ms": 0.0, "tm_ms": tm_ms, "percent": percent}
        sentences.append(sentence(ExplanationSentence.TIMES_FOR_THE_STROKE, **times))
    if zigzag.kept_fraction < KEPT_ENOUGH:
        stroke, longer = zigzag.stroke, zigzag.stroke / zigzag.kept_fraction
        values = _length(subject, zigzag, stroke)
        sentences.append(
            sentence(ExplanationSentence.STROKE_THAT_MAKES_UP, **values, counts=stroke, longer_counts=longer)
        )
    return sentences


def _best_times(subject: Subject, zigzag: ZigZag, tm_ms: float) -> Timing | None:
    """Return the longest whole TA, without TS, that keeps the fraction, or the Ix17 limit; None: no better."""
    ta_ms = float(max(1, math.floor(2.0 * (1.0 - TARGET_FRACTION) * tm_ms + 1e-9)))
    way = tuple(motor.commanded for motor in zigzag.move.motors)
    velocity, acceleration = (
        tuple(subject.setting(motor, number) for motor in subject.walk.motors) for number in (16, 17)
    )
    limits = Limits(velocity=velocity, acceleration=acceleration)
    # The previous move reversed what this one makes: the greatest change there is.
    before = tuple(
        (-distance if index == zigzag.index else distance) / tm_ms for index, distance in enumerate(way)
    )
    timing = effective_timing(LinearMove(distance=way, ta_ms=ta_ms, ts_ms=0.0, tm_ms=tm_ms), before, limits)
    longer = replace(timing, ta_ms=float(math.ceil(timing.ta_ms - 1e-9)))
    better = 1.0 - longer.ta_ms / (2.0 * tm_ms) > zigzag.kept_fraction + _WORTH_SAYING
    return longer if better and math.isclose(timing.tm_ms, tm_ms) else None


def timing_findings(subject: Subject) -> list[ProgramFinding]:
    """Return the findings about times; alike ones of several lines are merged."""
    grouped: dict[str, tuple[FindingCode, dict[str, Value], list[MoveAnalysis]]] = {}
    for move in subject.moves:
        if move.mode in RAMPED:
            for code, values in _of_move(subject, move):
                _, _, alike = grouped.setdefault(_key(code, values), (code, values, []))
                alike.append(move)
    return [
        finding(code, subject.lines(moves), **values, moves=len(moves)) for code, values, moves in grouped.values()
    ]


def rounding_findings(subject: Subject, text: ProgramText) -> list[ProgramFinding]:
    """Return a finding for each such word; an expression is evaluated with its variables at the end."""
    findings = []
    programs = {text.number: text.program, **text.subprograms}
    for number, program in programs.items():
        for line, statements in enumerate(program):
            for word in (statement for statement in statements if isinstance(statement, Set)):
                values = _compare_rounded_time(subject, word)
                if values:
                    findings.append(finding(FindingCode.TIME_ROUNDED, (subject.place_of(number, line),), **values))
    return findings


def _of_move(subject: Subject, move: MoveAnalysis) -> Iterator[tuple[FindingCode, dict[str, Value]]]:
    asked, used = move.asked, move.used
    acceleration_ms = max(asked.ta_ms, 2.0 * asked.ts_ms)
    if acceleration_ms > asked.ta_ms:
        yield FindingCode.S_CURVE_RULES, {"ta_ms": asked.ta_ms, "ts_ms": asked.ts_ms, "used_ms": acceleration_ms}
    least_ms = interrupt_ms(subject)
    if move.by_move_time and 0.0 < asked.tm_ms < least_ms:
        yield FindingCode.TIME_BELOW_INTERRUPT, {"tm_ms": asked.tm_ms, "interrupt_ms": least_ms}
    if _longer(used.tm_ms, asked.tm_ms) and asked.tm_ms > 0.0:
        yield _stretch(subject, move, acceleration_ms)
    if _longer(used.ta_ms, acceleration_ms) and not _longer(used.tm_ms, asked.tm_ms):
        yield FindingCode.RAMP_LENGTHENED, {"ta_ms": acceleration_ms, "used_ms": used.ta_ms}
    if _longer(acceleration_ms, used.ta_ms):
        yield FindingCode.RAMP_SHORTENED, {"ta_ms": acceleration_ms, "used_ms": used.ta_ms}


def interrupt_ms(subject: Subject) -> float:
    """Return the period of the real-time interrupt, in which the controller computes moves."""
    variables = subject.walk.variables
    return (variables.i(8) + 1.0) * servo_cycle_ms(variables.i(10))


def _stretch(subject: Subject, move: MoveAnalysis, acceleration_ms: float) -> tuple[FindingCode, dict[str, Value]]:
    """Return why a move takes longer than commanded."""
    times: dict[str, Value] = {"asked_ms": move.asked.tm_ms, "used_ms": move.used.tm_ms}
    if math.isclose(move.used.tm_ms, acceleration_ms, rel_tol=1e-9):
        return FindingCode.STRETCHED, times
    for motor in move.motors:
        limit = subject.setting(motor.motor, 16)
        if limit > 0.0 and math.isclose(abs(motor.commanded) / limit, move.used.tm_ms, rel_tol=1e-9):
            return FindingCode.STRETCHED_BY_VELOCITY, {**times, "variable": f"I{motor.motor}16", "limit": limit}
    return FindingCode.STRETCHED_BY_ACCELERATION, times


def _key(code: FindingCode, values: dict[str, Value]) -> str:
    """Return the key by which findings are merged: numbers that differ only by rounding are equal."""
    return " ".join([code, *(value if isinstance(value, str) else f"{value:.9g}" for value in values.values())])


def _longer(one_ms: float, other_ms: float) -> bool:
    return one_ms > other_ms * (1.0 + 1e-9)


def _compare_rounded_time(subject: Subject, word: Set) -> dict[str, Value]:
    """Return the commanded and the actual value, nothing if they are equal."""
    if word.word not in ("TA", "TS", "PVT"):
        return {}
    variables, dialect, step_ms = subject.walk.variables, subject.walk.variables.dialect, 1.0
    switch = dialect.segment_time_switch
    if word.word == "PVT" and switch is not None and variables.i(switch) == 0.0:
        step_ms = dialect.segment_step_ms  # where a setting lets TM give it, finer than a whole ms
    try:
        asked_ms = evaluate(word.value, variables, variables.i(15) == 0.0)
    except PmacError:
        return {}  # if the program came so far, an error has been reported
    used_ms = step_ms * math.floor(asked_ms / step_ms + 0.5)
    if abs(asked_ms - used_ms) <= 1e-9 * max(1.0, abs(asked_ms)):
        return {}
    return {"word": word.word, "asked_ms": asked_ms, "used_ms": used_ms}


def _believable(subject: Subject, zigzag: ZigZag) -> bool:
    """Whether the time is one that the controller cannot even compute: it cannot be intended."""
    return zigzag.move.asked.tm_ms >= interrupt_ms(subject)


def _length(subject: Subject, zigzag: ZigZag, counts: float) -> dict[str, Value]:
    return shown_length(subject.machine, subject.walk.motors[zigzag.index], counts)
