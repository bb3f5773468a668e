"""Where a program of somebody else writes what the console keeps in the controller: owner, heartbeat, its timers.

A number that the controller computes while it runs, as in `P(P5)=1`, is not known before.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress

from drivers.pmac.buffer_text import BufferKind, stored
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.watchdog import RUNNING, TOOL_HOMED, wait_timer, watchdog_timer
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import END_FLAG, OWN_VARIABLES

_NUMBER = r"\$[0-9A-F]+|\d+|\([^()]*\)"
_WRITTEN = re.compile(
    rf"(?<![A-Z])([PMI])\s*({_NUMBER})\s*(?:\.\.\s*({_NUMBER})|,\s*({_NUMBER})(?:\s*,\s*({_NUMBER}))?)?\s*=(?!=)",
    re.IGNORECASE,
)
"""`P5=`, `P(5)=`, `P5..9=`, `P5,3,2=` in an on-line command: one, a range, or so many that are so far apart."""


class OwnVariables:
    """What belongs to the console in a controller of one family: P1000 to P1023, M-variables and two timers."""

    def __init__(self, dialect: Dialect) -> None:
        own = {"P": set(OWN_VARIABLES), "M": {END_FLAG, *range(RUNNING, TOOL_HOMED + 1)}, "I": set[int]()}
        for timer in (watchdog_timer(dialect), wait_timer(dialect)):
            own[timer.name[0]].add(int(timer.name[1:]))
        self._own: Mapping[str, set[int]] = own

    def written(self, kind: BufferKind, text: str) -> tuple[str, ...]:
        """Return those that a line of a buffer writes, by names such as `P1000`; none of a bad line."""
        found = set[tuple[str, int]]()
        with suppress(PmacError):
            for _, statements in stored(kind, text):
                for statement in statements:
                    found.update(self._written(statement))
        return tuple(f"{letter}{number}" for letter, number in sorted(found) if number in self._own[letter])

    def _written(self, statement: syntax.Statement | syntax.PlcStatement) -> Iterator[tuple[str, int]]:
        if isinstance(statement, syntax.Assign) and statement.target.kind.value in self._own:
            with suppress(_ComputedError, PmacError):
                yield statement.target.kind.value, int(evaluate(statement.target.index, _Unknown()))
        elif isinstance(statement, syntax.Message) and statement.word == "CMD":
            for written in _WRITTEN.finditer(statement.text):
                with suppress(_ComputedError, PmacError):
                    yield from self._in_command(written)

    def _in_command(self, written: re.Match[str]) -> Iterator[tuple[str, int]]:
        letter, (first, last, count, step) = written[1].upper(), map(_number, written.groups()[1:])
        assert first is not None
        most = max(self._own[letter], default=0)  # what is beyond is not asked for, however long a range is
        if last is not None:
            numbers = range(first, min(last, most) + 1)
        elif count is None:
            numbers = range(first, first + 1)
        else:
            each = max(1 if step is None else step, 1)
            numbers = range(first, min(first + count * each, most + 1), each)
        for number in numbers:
            yield letter, number


def _number(text: str | None) -> int | None:
    """Return a number of an on-line command, read as a program reads that of a variable."""
    if text is None:
        return None
    ((_, (statement,)),) = stored(BufferKind.PROGRAM, f"P({text.strip('()')})=0")
    assert isinstance(statement, syntax.Assign)
    return int(evaluate(statement.target.index, _Unknown()))


class _ComputedError(Exception):
    """A number that depends on a variable."""


class _Unknown:
    def get(self, kind: VariableKind, index: int) -> float:
        raise _ComputedError
