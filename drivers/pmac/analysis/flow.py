"""Findings about how a program goes on: loops without an end, waits for a host, errors at run time."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.pmac.analysis.findings import Code, Finding, Level, Value
from drivers.pmac.analysis.subject import Subject
from drivers.pmac.analysis.walk import Ending, Left
from drivers.pmac.compensation.buffers import TableOrderError
from drivers.pmac.program_text import RefusedLine


def flow_findings(subject: Subject, refused: Iterable[RefusedLine]) -> list[Finding]:
    """Return what a program does that it does not say, and what of it the card does not even take."""
    walk = subject.walk
    findings = [_refused(line) for line in refused]
    if walk.error is not None:
        place = subject.place_of(walk.steps[-1].program, walk.steps[-1].line)
        values: dict[str, Value] = {"error": str(walk.error), "number": int(walk.error.code)}
        findings.append(Finding(code=Code.RUN_TIME_ERROR, level=Level.FAULT, lines=(place,), values=values))
    findings += [_endless(subject, left) for left in walk.left]
    if walk.ending is Ending.TOO_LONG:
        long: dict[str, Value] = {"steps": len(walk.steps)}
        findings.append(Finding(code=Code.TOO_LONG, level=Level.NOTICE, values=long))
    if not subject.moves:
        findings.append(Finding(code=Code.NO_MOTION, level=Level.NOTICE))
    return findings


def _refused(line: RefusedLine) -> Finding:
    values: dict[str, Value] = {"error": str(line.error), "number": int(line.error.code), "text": line.text}
    if isinstance(line.error, TableOrderError):
        values |= {"motor": line.error.motor, "lower": line.error.lower}
        return Finding(code=Code.TABLE_ORDER, level=Level.FAULT, lines=(line.place,), values=values)
    return Finding(code=Code.LINE_REFUSED, level=Level.FAULT, lines=(line.place,), values=values)


def _endless(subject: Subject, left: Left) -> Finding:
    """A loop that moves is a cut without an end; one that does not is a wait for somebody."""
    loop = left.circle.loop
    first, last = (loop.first, loop.last) if loop is not None else (left.line, left.line)
    here = (subject.place_of(subject.walk.number, first),)
    values: dict[str, Value] = {"passes": _passes(subject, left), "repeats": left.circle.period is not None}
    if not left.flags:
        return Finding(code=Code.ENDLESS_WITHOUT_FLAG, level=Level.WARNING, lines=here, values=values)
    values |= {"flags": ", ".join(f"{kind}{index}={value:g}" for (kind, index), value in left.flags.items())}
    moving = any(first <= subject.walk.steps[move.step].main_line <= last for move in subject.moves)
    if moving:
        return Finding(code=Code.ENDLESS_LOOP, level=Level.WARNING, lines=here, values=values)
    return Finding(code=Code.WAITS_FOR_FLAG, level=Level.NOTICE, lines=here, values=values)


def _passes(subject: Subject, left: Left) -> int:
    """Return how often the program came by: the pass in which the flag is set is made to its end, too."""
    steps = subject.walk.steps[: left.step + 1]
    return sum(step.place == steps[-1].place for step in steps)
