"""Where a program of somebody else writes the console's own P-variables: ownership, heartbeat, signature.

A number that the controller computes while it runs, as in `P(P5)=1`, is not known before.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress

from drivers.pmac.buffer_text import BufferKind, stored
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWN_VARIABLES

_WRITTEN = re.compile(
    r"(?<![A-Z])P\s*(?:(\d+)|\(\s*(\d+)\s*\))\s*(?:\.\.\s*(\d+)|,\s*(\d+)(?:\s*,\s*(\d+))?)?\s*=(?!=)",
    re.IGNORECASE,
)
"""`P5=`, `P(5)=`, `P5..9=`, `P5,3,2=` in an on-line command: one, a range, or so many that are so far apart."""


def own_variables_written(kind: BufferKind, text: str) -> tuple[str, ...]:
    """Return the console's variables that a line of a buffer writes, such as `P1000`; none of a bad line."""
    found = set[int]()
    with suppress(PmacError):
        for _, statements in stored(kind, text):
            for statement in statements:
                found.update(_written(statement))
    return tuple(f"P{number}" for number in sorted(found & OWN_VARIABLES))


def _written(statement: syntax.Statement | syntax.PlcStatement) -> Iterator[int]:
    if isinstance(statement, syntax.Assign) and statement.target.kind is VariableKind.P:
        with suppress(_ComputedError, PmacError):
            yield int(evaluate(statement.target.index, _Unknown()))
    elif isinstance(statement, syntax.Message) and statement.word == "CMD":
        for written in _WRITTEN.finditer(statement.text):
            yield from _numbers(written)


def _numbers(written: re.Match[str]) -> Iterator[int]:
    first = int(written[1] or written[2])
    last, count, step = (None if each is None else int(each) for each in written.groups()[2:])
    most = max(OWN_VARIABLES)  # what is beyond is not asked for, however long a range is
    if last is not None:
        yield from range(first, min(last, most) + 1)
    elif count is None:
        yield first
    else:
        each = max(1 if step is None else step, 1)
        yield from range(first, min(first + count * each, most + 1), each)


class _ComputedError(Exception):
    """A number that depends on a variable."""


class _Unknown:
    def get(self, kind: VariableKind, index: int) -> float:
        raise _ComputedError
