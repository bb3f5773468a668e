"""Findings about TA, TS and PVT words whose times are no whole ms: the card rounds them when it executes them."""

from __future__ import annotations

import math

from drivers.pmac.analysis.findings import Code, Finding, Level, Value
from drivers.pmac.analysis.subject import Subject
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.syntax import Set
from drivers.pmac.program_text import ProgramText
from drivers.pmac.variables import VariableStore


def rounding_findings(subject: Subject, text: ProgramText) -> list[Finding]:
    """Return a finding for each such word; an expression is taken with what its variables are at the end."""
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


def _finding(place: int, values: dict[str, Value]) -> Finding:
    return Finding(code=Code.TIME_ROUNDED, level=Level.NOTICE, lines=(place,), values=values)


def _rounded(subject: Subject, word: Set) -> dict[str, Value]:
    """Return what is asked for and what is used, nothing where they are the same."""
    if word.word not in ("TA", "TS", "PVT"):
        return {}
    variables = subject.walk.variables
    step_ms = _segment_step_ms(variables) if word.word == "PVT" else 1.0
    try:
        asked_ms = evaluate(word.value, variables, variables.i(15) == 0.0)
    except PmacError:
        return {}  # if the program came so far, it has been told as an error
    used_ms = step_ms * math.floor(asked_ms / step_ms + 0.5)
    if abs(asked_ms - used_ms) <= 1e-9 * max(1.0, abs(asked_ms)):
        return {}
    return {"word": word.word, "asked_ms": asked_ms, "used_ms": used_ms}


def _segment_step_ms(variables: VariableStore) -> float:
    """Return the steps of the time of a PVT segment; finer where a setting lets TM give it."""
    switch = variables.dialect.segment_time_switch
    fine = switch is not None and variables.i(switch) == 0.0
    return variables.dialect.segment_step_ms if fine else 1.0
