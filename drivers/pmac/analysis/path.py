"""Findings about the path: stroke lost to blending, arcs not made as arcs, and the final tool position."""

from __future__ import annotations

from itertools import pairwise

from drivers.pmac.analysis.explanation import KEPT_ENOUGH, ZigZag
from drivers.pmac.analysis.findings import Code, ProgramFinding, finding
from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis
from drivers.pmac.analysis.subject import Subject, moves
from drivers.pmac.analysis.timeline import SAME_COUNTS
from drivers.pmac.analysis.units import shown_length
from drivers.pmac.analysis.walk import Ending
from drivers.pmac.dialect import Setting
from drivers.pmac.requests import HomeRequest, TriggerRequest


def path_findings(subject: Subject, zigzag: ZigZag | None) -> list[ProgramFinding]:
    """Return the problems of the motors' paths."""
    findings = [*_lost_strokes(subject), *_one_sided(subject, zigzag), *_straight_circles(subject)]
    # The end of a program is known only when it was followed to its end.
    return [*findings, *_end(subject)] if subject.walk.ending is Ending.FINISHED else findings


def _lost_strokes(subject: Subject) -> list[ProgramFinding]:
    """Find moves that reverse short of both ends: for each commanded distance, the most frequent actual one."""
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


def _lost(subject: Subject, index: int, stroke: float, made: float, found: list[MoveAnalysis]) -> ProgramFinding:
    motor = subject.walk.motors[index]
    return finding(
        Code.STROKE_LOST,
        subject.lines(found),
        motor=motor,
        stroke_counts=stroke,
        made_counts=made,
        **shown_length(subject.machine, motor, stroke),
        made_length=shown_length(subject.machine, motor, made)["length"],
        kept_percent=100.0 * made / stroke,
        moves=len(found),
    )


def _one_sided(subject: Subject, zigzag: ZigZag | None) -> list[ProgramFinding]:
    """Find a zig-zag that starts from one of its ends: its middle is half a stroke off the starting point."""
    if zigzag is None or zigzag.index != subject.tool:
        return []
    first = zigzag.moves[0].motors[zigzag.index]
    values = {
        "begins_counts": zigzag.begins_at,
        "middle_counts": first.target - 0.5 * first.commanded,
        "deeper_um": subject.um(0.5 * first.commanded),
    }
    return [finding(Code.ONE_SIDED, subject.lines(zigzag.moves), **values)]


def _straight_circles(subject: Subject) -> list[ProgramFinding]:
    """Find arcs that are made as LINEAR moves, because segmentation is off."""
    steps = subject.walk.steps
    found = [move for move in subject.moves if move.mode == "CIRCLE" and steps[move.step].segment_ms <= 0.0]
    if not found:
        return []
    variable = f"I{subject.walk.variables.dialect.index(Setting.SEGMENT_MS)}"
    return [finding(Code.CIRCLE_STRAIGHT, subject.lines(found), moves=len(found), variable=variable)]


def _end(subject: Subject) -> list[ProgramFinding]:
    """Check the tool's last move: positive is infeed, and after the cut only retraction is right."""
    tool = subject.tool
    if tool is None:
        return []
    return _plunge(subject, tool) or _left_deeper(subject, tool)


def _plunge(subject: Subject, tool: int) -> list[ProgramFinding]:
    commanded = [move for move in subject.moves if moves(move, tool)]
    if not subject.cut or commanded[-1].number <= subject.cut[-1].number:
        return []
    last = commanded[-1]
    motor = last.motors[tool]
    deepest = max(move.motors[tool].target for move in subject.cut)
    if motor.commanded <= 0.0 or motor.target <= deepest:
        return []
    per_mm = subject.machine.tool.counts_per_mm
    mm, deeper_mm = motor.commanded / per_mm, (motor.target - deepest) / per_mm
    return [finding(Code.PLUNGE, subject.lines([last]), counts=motor.commanded, mm=mm, deeper_mm=deeper_mm)]


def _left_deeper(subject: Subject, tool: int) -> list[ProgramFinding]:
    """Find a tool that ends further in than it started, whatever moved it there."""
    walk = subject.walk
    deeper = walk.steps[-1].at[tool] - walk.start[tool]
    if deeper <= SAME_COUNTS:
        return []
    commanded = [move.step for move in subject.moves if moves(move, tool)]
    homed = [
        place
        for place, step in enumerate(walk.steps)
        if isinstance(step.request, TriggerRequest)
        or (isinstance(step.request, HomeRequest) and walk.motors[tool] in step.request.motors)
    ]
    last = walk.steps[max(commanded + homed)]
    lines = (subject.place_of(last.program, last.line),)
    return [finding(Code.ENDS_DEEPER, lines, counts=deeper, mm=deeper / subject.machine.tool.counts_per_mm)]


def _rounded(counts: float) -> float:
    """Return a distance without arithmetic rounding, so that like distances are equal."""
    return float(f"{counts:.9g}")
