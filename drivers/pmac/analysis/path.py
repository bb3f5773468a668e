"""Findings about the path: strokes that blending takes away, and which way the last move goes."""

from __future__ import annotations

from itertools import pairwise

from drivers.pmac.analysis.findings import Code, Finding, Level, Value
from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis
from drivers.pmac.analysis.step import SAME_COUNTS
from drivers.pmac.analysis.subject import Subject, moves
from drivers.pmac.analysis.units import shown_length
from drivers.pmac.analysis.zigzag import ZigZag

KEPT_ENOUGH = 0.98
"""A stroke that keeps this share is not called lost."""


def path_findings(subject: Subject, zigzag: ZigZag | None) -> list[Finding]:
    """Return what is wrong with where the motors go."""
    return [*_lost_strokes(subject), *_one_sided(subject, zigzag), *_end(subject)]


def _lost_strokes(subject: Subject) -> list[Finding]:
    """Moves that turn round short of both their ends: for each way told, the way that is made most often."""
    grouped: dict[tuple[int, float], list[tuple[MoveAnalysis, MotorMove]]] = {}
    for before, move in pairwise(subject.moves):
        for index, motor in enumerate(move.motors):
            if motor.turns and before.motors[index].turns and before.blended:
                grouped.setdefault((index, _rounded(abs(motor.commanded))), []).append((move, motor))
    findings = []
    for (index, stroke), found in grouped.items():
        made = [_rounded(abs(motor.made)) for _, motor in found]
        usual = max(set(made), key=made.count)
        if stroke > SAME_COUNTS and usual < KEPT_ENOUGH * stroke:
            findings.append(_lost(subject, index, stroke, usual, [move for move, _ in found]))
    return findings


def _lost(subject: Subject, index: int, stroke: float, made: float, found: list[MoveAnalysis]) -> Finding:
    motor = subject.walk.motors[index]
    made_length = shown_length(subject.machine, motor, made)
    values: dict[str, Value] = {
        "motor": motor,
        "stroke_counts": stroke,
        "made_counts": made,
        **shown_length(subject.machine, motor, stroke),
        "made_length": made_length["length"],
        "kept_percent": 100.0 * made / stroke,
        "moves": len(found),
    }
    return Finding(code=Code.STROKE_LOST, level=Level.WARNING, lines=subject.lines(found), values=values)


def _one_sided(subject: Subject, zigzag: ZigZag | None) -> list[Finding]:
    """A zig-zag that sets out from one of its ends: its middle is half a stroke off the place where it began."""
    if zigzag is None or zigzag.index != subject.tool:
        return []
    first = zigzag.moves[0].motors[zigzag.index]
    values = {
        "begins_counts": zigzag.begins_at,
        "middle_counts": first.target - 0.5 * first.commanded,
        "deeper_um": subject.um(0.5 * first.commanded),
    }
    return [Finding(code=Code.ONE_SIDED, level=Level.NOTICE, lines=subject.lines(zigzag.moves), values=values)]


def _end(subject: Subject) -> list[Finding]:
    """The tool's last move: positive is infeed, and behind the cut the way can only be out."""
    tool = subject.tool
    told = [move for move in subject.moves if tool is not None and moves(move, tool)]
    if tool is None or not told:
        return []
    last = told[-1]
    motor = last.motors[tool]
    deepest = max((move.motors[tool].target for move in subject.cut), default=motor.target)
    per_mm = subject.machine.tool.counts_per_mm
    if subject.cut and last.number > subject.cut[-1].number and motor.commanded > 0.0 and motor.target > deepest:
        values = {
            "counts": motor.commanded,
            "mm": motor.commanded / per_mm,
            "deeper_mm": (motor.target - deepest) / per_mm,
        }
        return [Finding(code=Code.PLUNGE, level=Level.FAULT, lines=subject.lines([last]), values=values)]
    deeper = motor.target - subject.walk.start[tool]
    if deeper <= SAME_COUNTS:
        return []
    values = {"counts": deeper, "mm": deeper / per_mm}
    return [Finding(code=Code.ENDS_DEEPER, level=Level.NOTICE, lines=subject.lines([last]), values=values)]


def _rounded(counts: float) -> float:
    """Return a way without the rounding of the arithmetic, so that like ways are equal."""
    return float(f"{counts:.9g}")
