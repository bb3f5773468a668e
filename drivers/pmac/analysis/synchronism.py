"""Findings about the tool against the spindle: what stops them together, and what lets them drift apart.

Tool and spindle are motors of one program here, so that a stop stops both. With a spindle that turns independently
(an external time base), the same stop loses the angle: that is why it is reported.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.pmac.analysis.drift import lobes_of
from drivers.pmac.analysis.findings import Code, ProgramFinding, Value
from drivers.pmac.analysis.moves import MoveAnalysis
from drivers.pmac.analysis.step import Step
from drivers.pmac.analysis.subject import Subject, moves
from drivers.pmac.requests import BlendBreak, DwellRequest, Halt
from profiles.findings import Severity

DRIFT_DEG = 1e-3
"""Least reported drift per turn: a degree in a thousand turns."""

SPEED_TOLERANCE = 1e-6

USELESS_LOBE_DEG = 60.0
"""Error of the lobe angle at which a compensation no longer removes anything: |1 - exp(j 60 deg)| = 1."""

_WHOLE = 0.25
"""A path whose lobes per turn are further than this from an integer is not drifting: it does not fit the turn."""


def synchronism_findings(subject: Subject) -> list[ProgramFinding]:
    """Return what disturbs the synchronism of tool and spindle in the cut."""
    if not subject.cut:
        return []
    return [*_stops(subject), *_feedrate(subject), *_speed(subject), *_drift(subject)]


def _stops(subject: Subject) -> list[ProgramFinding]:
    """Find DWELL, or a blend that breaks, between the first and the last move of the cut."""
    inside = subject.walk.steps[subject.cut[0].step : subject.cut[-1].step]
    found = [
        (Code.DWELL_IN_CUT, [step for step in inside if isinstance(step.request, DwellRequest)]),
        (Code.STOP_IN_CUT, [step for step in inside if isinstance(step.request, BlendBreak | Halt)]),
    ]
    return [
        ProgramFinding(
            code=code,
            severity=Severity.WARNING,
            lines=_lines(subject, steps),
            values={"stops": len(steps), "ms": sum(step.ends_ms - step.begins_ms for step in steps)},
        )
        for code, steps in found
        if steps
    ]


def _lines(subject: Subject, steps: Sequence[Step]) -> tuple[int, ...]:
    return tuple(sorted({subject.place_of(step.program, step.line) for step in steps}))


def _feedrate(subject: Subject) -> list[ProgramFinding]:
    by_feed = [move for move in subject.cut if move.mode in ("LINEAR", "CIRCLE") and not move.by_move_time]
    if not by_feed:
        return []
    times = [move.asked.tm_ms for move in by_feed]
    values: dict[str, Value] = {"moves": len(by_feed), "least_ms": min(times), "most_ms": max(times)}
    lines = subject.lines(by_feed)
    return [ProgramFinding(code=Code.FEEDRATE_IN_CUT, severity=Severity.WARNING, lines=lines, values=values)]


def _speed(subject: Subject) -> list[ProgramFinding]:
    """Check that the spindle turns evenly while the tool moves; the first and the last such move do not count."""
    assert subject.tool is not None
    together = [move for move in subject.cut if moves(move, subject.tool)][1:-1]
    speeds = [(_speed_rpm(subject, move), move) for move in together]
    if not speeds:
        return []
    slowest, fastest = min(rpm for rpm, _ in speeds), max(rpm for rpm, _ in speeds)
    if fastest - slowest <= SPEED_TOLERANCE * abs(fastest):
        return []
    usual = sorted(rpm for rpm, _ in speeds)[len(speeds) // 2]
    odd = [move for rpm, move in speeds if abs(rpm - usual) > SPEED_TOLERANCE * abs(usual)]
    values: dict[str, Value] = {"slowest_rpm": slowest, "fastest_rpm": fastest, "usual_rpm": usual}
    return [
        ProgramFinding(code=Code.SPEED_CHANGES, severity=Severity.WARNING, lines=subject.lines(odd), values=values)
    ]


def _speed_rpm(subject: Subject, move: MoveAnalysis) -> float:
    assert subject.spindle is not None
    return subject.rpm(move.motors[subject.spindle].commanded / move.used.tm_ms)


def _drift(subject: Subject) -> list[ProgramFinding]:
    lobes = lobes_of(subject)
    if lobes is None:
        return []
    lines = subject.lines(subject.cut)
    per_turn = round(lobes.per_turn)
    if not per_turn or abs(lobes.per_turn - per_turn) > _WHOLE:
        values: dict[str, Value] = {"lobes": lobes.per_turn}
        return [ProgramFinding(code=Code.NO_WHOLE_LOBES, severity=Severity.WARNING, lines=lines, values=values)]
    # One turn later the tool is where it was when the spindle has made the angle of `per_turn` lobes.
    drift_deg = 360.0 * (per_turn / lobes.per_turn - 1.0)
    if abs(drift_deg) < DRIFT_DEG:
        return []
    turns = USELESS_LOBE_DEG / per_turn / abs(drift_deg)
    values = {
        "lobes": per_turn,
        "counts_per_turn": drift_deg / 360.0 * subject.machine.spindle.counts_per_rev,
        "deg_per_turn": drift_deg,
        "useless_after_turns": turns,
        "useless_after_s": 60.0 * turns / abs(lobes.speed_rpm),
    }
    return [ProgramFinding(code=Code.DRIFT, severity=Severity.WARNING, lines=lines, values=values)]
