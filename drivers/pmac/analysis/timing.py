"""Findings about times: the controller's actual TA, TS, TM and F, and why; among them fractions of a ms."""

from __future__ import annotations

import math
from collections.abc import Iterator

from drivers.pmac.analysis.findings import Code, ProgramFinding, Value, finding
from drivers.pmac.analysis.moves import RAMPED, MoveAnalysis
from drivers.pmac.analysis.subject import Subject
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.syntax import Set
from drivers.pmac.program_text import ProgramText
from drivers.pmac.settings import servo_cycle_ms


def timing_findings(subject: Subject) -> list[ProgramFinding]:
    """Return the findings about times; alike ones of several lines are merged."""
    grouped: dict[str, tuple[Code, dict[str, Value], list[MoveAnalysis]]] = {}
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
                values = _rounded(subject, word)
                if values:
                    findings.append(finding(Code.TIME_ROUNDED, (subject.place_of(number, line),), **values))
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


def _rounded(subject: Subject, word: Set) -> dict[str, Value]:
    """Return the commanded and the actual value, nothing where they are equal."""
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
