"""The TA and TS of a text taken from elsewhere, as an operator would change them."""

from __future__ import annotations

from dataclasses import replace

from drivers.pmac.language.syntax import Number, Program, Set, Statement
from drivers.pmac.program_text import ProgramText


def with_times(text: ProgramText, ta_ms: float | None, ts_ms: float | None) -> ProgramText:
    """Return the programs with other values in their TA and TS words; None leaves them as they are."""
    times = {word: Number(float(ms)) for word, ms in (("TA", ta_ms), ("TS", ts_ms)) if ms is not None}
    if not times:
        return text
    subprograms = {number: _changed(program, times) for number, program in text.subprograms.items()}
    return replace(text, program=_changed(text.program, times), subprograms=subprograms)


def _changed(program: Program, times: dict[str, Number]) -> Program:
    def other(statement: Statement) -> Statement:
        if isinstance(statement, Set) and statement.word in times:
            return Set(statement.word, times[statement.word])
        return statement

    return tuple(tuple(other(statement) for statement in line) for line in program)
