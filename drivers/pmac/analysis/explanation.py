"""Explain why a zig-zag does not reach its stroke, in sentences derived from the computed numbers.

The lobe to be removed is assumed to be a sine of exactly the commanded stroke, in phase with the path.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

from drivers.pmac.analysis.findings import Said, Sentence, Value
from drivers.pmac.analysis.path import KEPT_ENOUGH
from drivers.pmac.analysis.subject import Subject
from drivers.pmac.analysis.timing import interrupt_ms
from drivers.pmac.analysis.units import shown_length
from drivers.pmac.analysis.zigzag import ZigZag
from drivers.pmac.trajectory.linear import Limits, LinearMove, Timing, effective_timing
from profiles.axis.servo import sampled_response

WANTED_SHARE = 0.95
"""The fraction of the stroke for which times are searched."""

_WORTH_SAYING = 0.01

_SAMPLES = 720


def explain(subject: Subject, zigzag: ZigZag | None) -> tuple[Sentence, ...]:
    """Return the explanation of a zig-zag that loses stroke or time; empty if there is nothing to explain."""
    if zigzag is None:
        return ()
    stretched = zigzag.move.used.tm_ms > zigzag.move.asked.tm_ms * (1.0 + 1e-9)
    if zigzag.kept >= KEPT_ENOUGH and not stretched:
        return ()
    sentences = [_told(subject, zigzag), *_times(subject, zigzag, stretched), _stroke(subject, zigzag)]
    if zigzag.index == subject.tool:
        sentences += _left(subject, zigzag)
    return tuple([*sentences, *_advice(subject, zigzag, stretched)])


def _told(subject: Subject, zigzag: ZigZag) -> Sentence:
    move = zigzag.move
    values: dict[str, Value] = {**_length(subject, zigzag, zigzag.stroke), "tm_ms": move.asked.tm_ms}
    if not _believable(subject, zigzag):
        return Sentence(code=Said.TOLD_WITHOUT_TIME, values=values)
    return Sentence(code=Said.TOLD, values={**values, "hz": 500.0 / move.asked.tm_ms})


def _times(subject: Subject, zigzag: ZigZag, stretched: bool) -> list[Sentence]:
    asked, used = zigzag.move.asked, zigzag.move.used
    times: dict[str, Value] = {"ta_ms": asked.ta_ms, "ts_ms": asked.ts_ms, "used_ms": used.ta_ms}
    sentences = [Sentence(code=Said.ACCELERATION_TIME, values=times)]
    if not stretched:
        return sentences
    moved: dict[str, Value] = {"asked_ms": asked.tm_ms, "used_ms": used.tm_ms, "hz": 500.0 / used.tm_ms}
    sentences.append(Sentence(code=Said.MOVE_STRETCHED, values=moved))
    spindle = subject.spindle
    way = zigzag.move.motors[spindle].commanded if spindle is not None and spindle != zigzag.index else 0.0
    if not way:
        return sentences
    made: dict[str, Value] = {"hz": 500.0 / used.tm_ms, "rpm": subject.rpm(way / used.tm_ms)}
    if not _believable(subject, zigzag):
        return [*sentences, Sentence(code=Said.SPEED_MADE, values=made)]
    told: dict[str, Value] = {
        "asked_hz": 500.0 / asked.tm_ms,
        "asked_rpm": subject.rpm(way / asked.tm_ms),
        "times": used.tm_ms / asked.tm_ms,
    }
    return [*sentences, Sentence(code=Said.SLOWED_DOWN, values={**made, **told})]


def _stroke(subject: Subject, zigzag: ZigZag) -> Sentence:
    values: dict[str, Value] = {
        **_length(subject, zigzag, zigzag.stroke),
        **{f"made_{key}": value for key, value in _length(subject, zigzag, zigzag.made).items()},
        "percent": 100.0 * zigzag.kept,
    }
    return Sentence(code=Said.STROKE_MADE, values=values)


def _left(subject: Subject, zigzag: ZigZag) -> list[Sentence]:
    """State the residual on a part whose lobe is the commanded stroke: by the path alone, then with the servo."""
    stroke_um, frequency_hz = subject.um(zigzag.stroke), 500.0 / zigzag.move.used.tm_ms
    lost_um = stroke_um - subject.um(zigzag.made)
    blended: dict[str, Value] = {
        "left_um": lost_um,
        "stroke_um": stroke_um,
        "percent": 100.0 * lost_um / stroke_um,
    }
    response = complex(sampled_response(subject.machine, frequency_hz))
    left = abs(1.0 - fundamental_share(subject, zigzag) * response)
    servo: dict[str, Value] = {
        "hz": frequency_hz,
        "gain": abs(response),
        "late_deg": -math.degrees(cmath.phase(response)),
        "left_um": left * stroke_um,
        "stroke_um": stroke_um,
        "percent": 100.0 * left,
    }
    return [
        Sentence(code=Said.LEFT_BY_BLENDING, values=blended),
        Sentence(code=Said.LEFT_WITH_THE_SERVO, values=servo),
    ]


def fundamental_share(subject: Subject, zigzag: ZigZag) -> float:
    """Return the fundamental of the actual path, as a fraction of a sine with the commanded stroke."""
    period_ms = 2.0 * zigzag.move.used.tm_ms
    total = 0j
    for sample in range(_SAMPLES):
        share = sample / _SAMPLES
        place = subject.timeline.position(zigzag.index, zigzag.move.begins_ms + share * period_ms)
        total += place * cmath.exp(-2j * math.pi * share)
    return 4.0 * abs(total) / _SAMPLES / zigzag.stroke


def _advice(subject: Subject, zigzag: ZigZag, stretched: bool) -> list[Sentence]:
    tm_ms = zigzag.move.asked.tm_ms if _believable(subject, zigzag) else zigzag.move.used.tm_ms
    sentences = []
    if stretched and _believable(subject, zigzag):
        values: dict[str, Value] = {"tm_ms": tm_ms, "ta_ms": math.floor(tm_ms), "ts_ms": math.floor(0.5 * tm_ms)}
        sentences.append(Sentence(code=Said.TIMES_FOR_THE_SPEED, values=values))
    best = _best_times(subject, zigzag, tm_ms)
    if best is not None:
        share = 1.0 - best.ta_ms / (2.0 * tm_ms)
        times: dict[str, Value] = {"ta_ms": best.ta_ms, "ts_ms": 0.0, "tm_ms": tm_ms, "percent": 100.0 * share}
        sentences.append(Sentence(code=Said.TIMES_FOR_THE_STROKE, values=times))
    if zigzag.kept < KEPT_ENOUGH:
        longer = zigzag.stroke / zigzag.kept
        values = {**_length(subject, zigzag, zigzag.stroke), "counts": zigzag.stroke, "longer_counts": longer}
        sentences.append(Sentence(code=Said.STROKE_THAT_MAKES_UP, values=values))
    return sentences


def _best_times(subject: Subject, zigzag: ZigZag, tm_ms: float) -> Timing | None:
    """Return the longest whole TA, without TS, that keeps the fraction, or the Ix17 limit; None: no better."""
    ta_ms = float(max(1, math.floor(2.0 * (1.0 - WANTED_SHARE) * tm_ms + 1e-9)))
    way = tuple(motor.commanded for motor in zigzag.move.motors)
    limits = Limits(
        velocity=tuple(subject.setting(motor, 16) for motor in subject.walk.motors),
        acceleration=tuple(subject.setting(motor, 17) for motor in subject.walk.motors),
    )
    # The previous move reversed what this one makes: the greatest change there is.
    before = tuple(
        (-distance if index == zigzag.index else distance) / tm_ms for index, distance in enumerate(way)
    )
    timing = effective_timing(LinearMove(distance=way, ta_ms=ta_ms, ts_ms=0.0, tm_ms=tm_ms), before, limits)
    longer = replace(timing, ta_ms=float(math.ceil(timing.ta_ms - 1e-9)))
    better = 1.0 - longer.ta_ms / (2.0 * tm_ms) > zigzag.kept + _WORTH_SAYING
    return longer if better and math.isclose(timing.tm_ms, tm_ms) else None


def _believable(subject: Subject, zigzag: ZigZag) -> bool:
    """Whether the time is one that the controller cannot even compute: it cannot be intended."""
    return zigzag.move.asked.tm_ms >= interrupt_ms(subject)


def _length(subject: Subject, zigzag: ZigZag, counts: float) -> dict[str, Value]:
    return shown_length(subject.machine, subject.walk.motors[zigzag.index], counts)
