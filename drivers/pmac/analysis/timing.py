"""Findings about times: the controller's actual TA, TS, TM and F, and why; among them fractions of a ms."""

from __future__ import annotations

import math
from collections.abc import Iterator

from drivers.pmac.analysis.findings import Code, ProgramFinding, Value
from drivers.pmac.analysis.moves import MoveAnalysis
from drivers.pmac.analysis.subject import Subject
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.syntax import Set
from drivers.pmac.program_text import ProgramText
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.variables import VariableStore
from profiles.findings import Severity

_RAMPED = ("LINEAR", "CIRCLE")

_LEVELS = {
    Code.STRETCHED: Severity.WARNING,
    Code.STRETCHED_BY_VELOCITY: Severity.WARNING,
    Code.STRETCHED_BY_ACCELERATION: Severity.WARNING,
    Code.TIME_BELOW_INTERRUPT: Severity.WARNING,
}


def timing_findings(subject: Subject) -> list[ProgramFinding]:
    """Return the findings about times; alike ones of several lines are merged."""
    grouped: dict[str, tuple[Code, dict[str, Value], list[MoveAnalysis]]] = {}
    for move in subject.moves:
        if move.mode in _RAMPED:
            for code, values in _of_move(subject, move):
                _, _, alike = grouped.setdefault(_key(code, values), (code, values, []))
                alike.append(move)
    return [
        ProgramFinding(
            code=code,
            severity=_LEVELS.get(code, Severity.NOTICE),
            lines=subject.lines(moves),
            values={**values, "moves": len(moves)},
        )
        for code, values, moves in grouped.values()
    ]


def rounding_findings(subject: Subject, text: ProgramText) -> list[ProgramFinding]:
    """Return a finding for each such word; an expression is evaluated with its variables at the end."""
    findings = []
    programs = {text.number: text.program, **text.subprograms}
    for number, program in programs.items():
        for line, statements in enumerate(program):
            for word in (statement for statement in statements if isinstance(statement, Set)):
                values = _rounded(subject, word)
                if values:
                    place = subject.place_of(number, line)
                    findings.append(_finding(place, values))
    return findings


def _of_move(subject: Subject, move: MoveAnalysis) -> Iterator[tuple[Code, dict[str, Value]]]:
    asked, used = move.asked, move.used
    acceleration_ms = max(asked.ta_ms, 2.0 * asked.ts_ms)
    if acceleration_ms > asked.ta_ms:
        yield Code.S_CURVE_RULES, {"ta_ms": asked.ta_ms, "ts_ms": asked.ts_ms, "used_ms": acceleration_ms}
    least_ms = interrupt_ms(subject)
    if move.by_move_time and 0.0 < asked.tm_ms < least_ms:
        yield Code.TIME_BELOW_INTERRUPT, {"tm_ms": asked.tm_ms, "interrupt_ms": least_ms}
    if _longer(used.tm_ms, asked.tm_ms) and asked.tm_ms > 0.0:
        yield _stretch(subject, move, acceleration_ms)
    if _longer(used.ta_ms, acceleration_ms) and not _longer(used.tm_ms, asked.tm_ms):
        yield Code.RAMP_LENGTHENED, {"ta_ms": acceleration_ms, "used_ms": used.ta_ms}
    if _longer(acceleration_ms, used.ta_ms):
        yield Code.RAMP_SHORTENED, {"ta_ms": acceleration_ms, "used_ms": used.ta_ms}


def interrupt_ms(subject: Subject) -> float:
    """Return the period of the real-time interrupt, in which the controller computes moves."""
    variables = subject.walk.variables
    return (variables.i(8) + 1.0) * servo_cycle_ms(variables.i(10))


def _stretch(subject: Subject, move: MoveAnalysis, acceleration_ms: float) -> tuple[Code, dict[str, Value]]:
    """Return why a move takes longer than commanded."""
    times: dict[str, Value] = {"asked_ms": move.asked.tm_ms, "used_ms": move.used.tm_ms}
    if math.isclose(move.used.tm_ms, acceleration_ms, rel_tol=1e-9):
        return Code.STRETCHED, times
    for motor in move.motors:
        limit = subject.setting(motor.motor, 16)
        if limit > 0.0 and math.isclose(abs(motor.commanded) / limit, move.used.tm_ms, rel_tol=1e-9):
            return Code.STRETCHED_BY_VELOCITY, {**times, "variable": f"I{motor.motor}16", "limit": limit}
    return Code.STRETCHED_BY_ACCELERATION, times


def _key(code: Code, values: dict[str, Value]) -> str:
    """Return the key by which findings are merged: numbers that differ only by rounding are equal."""
    return " ".join([code, *(value if isinstance(value, str) else f"{value:.9g}" for value in values.values())])


def _longer(one_ms: float, other_ms: float) -> bool:
    return one_ms > other_ms * (1.0 + 1e-9)


def _finding(place: int, values: dict[str, Value]) -> ProgramFinding:
    return ProgramFinding(code=Code.TIME_ROUNDED, severity=Severity.NOTICE, lines=(place,), values=values)


def _rounded(subject: Subject, word: Set) -> dict[str, Value]:
    """Return the commanded and the actual value, nothing where they are equal."""
    if word.word not in ("TA", "TS", "PVT"):
        return {}
    variables = subject.walk.variables
    step_ms = _segment_step_ms(variables) if word.word == "PVT" else 1.0
    try:
        asked_ms = evaluate(word.value, variables, variables.i(15) == 0.0)
    except PmacError:
        return {}  # if the program came so far, an error has been reported
    used_ms = step_ms * math.floor(asked_ms / step_ms + 0.5)
    if abs(asked_ms - used_ms) <= 1e-9 * max(1.0, abs(asked_ms)):
        return {}
    return {"word": word.word, "asked_ms": asked_ms, "used_ms": used_ms}


def _segment_step_ms(variables: VariableStore) -> float:
    """Return the resolution of a PVT segment's time; finer where a setting lets TM give it."""
    switch = variables.dialect.segment_time_switch
    fine = switch is not None and variables.i(switch) == 0.0
    return variables.dialect.segment_step_ms if fine else 1.0
