"""Lines that are read once and executed many times: what a host that polls its machine sends.

`compiled` reads a line as `line.commands` would, with the same scanner and in the same order, and returns what to
execute. It does so only for commands whose reading depends on nothing but their text: an address, a report, one
variable, or a constant for a P-, Q- or M-variable. For any other line, and for one that is refused, it returns
None: such a line is read anew each time. A host that fills a buffer or a table is read differently, which the
caller has to rule out.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.expressions import parse_expression
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import Number, VariableKind
from drivers.simulator.commands import addressing, status, systems, values
from drivers.simulator.context import Context

Step = Callable[[Context], None]
MOST_LINES = 256  # that are remembered
MOST_CHARACTERS = 255

_NOT_HERE = re.compile(r"[^#&?%PVFIQM0-9.=\s$-]", re.IGNORECASE)
_MAY_SET = (VariableKind.P, VariableKind.Q, VariableKind.M)


@lru_cache(maxsize=MOST_LINES)
def compiled(
    text: str, word_at: Callable[[Scanner], str | None], letters: re.Pattern[str]
) -> tuple[Step, ...] | None:
    """Return the commands of a line, or None.

    `word_at` consumes a word that is neither a variable nor a letter, `letters` is the pattern of those.
    """
    if _NOT_HERE.search(text) or len(text) > MOST_CHARACTERS:
        return None
    try:
        scanner = Scanner(text)
        steps: list[Step] = []
        while not scanner.at_end:
            step = _step(scanner, text, word_at(scanner), letters)
            if step is None:
                return None
            steps.append(step)
    except PmacError:
        return None
    return tuple(steps)


def _step(scanner: Scanner, text: str, word: str | None, letters: re.Pattern[str]) -> Step | None:
    match word:
        case "#":
            number = scanner.take_integer()
            named = number is not None and not scanner.accept("->")
            return (lambda context: addressing.select_motor(context, number or 0)) if named else None
        case "&":
            number = scanner.take_integer()
            return None if number is None else lambda context: addressing.select_system(context, number)
        case "?":
            return status.of_marks(status.count_marks(scanner, text))
        case "%":
            return systems.say_override if scanner.take_number() is None else None
        case None:
            return _variable(scanner) or _report(scanner, letters)
        case _:
            return None


def _report(scanner: Scanner, letters: re.Pattern[str]) -> Step | None:
    """P, V or F; `V=5` would preset an axis."""
    if scanner.rest[1:2] == "=":
        return None
    return status.REPORTS.get(scanner.take(letters) or "")


def _variable(scanner: Scanner) -> Step | None:
    """Report one variable, or set it to a constant. Raises PmacError: anything else that begins like that."""
    start = scanner.mark()
    kind = next((kind for kind in VariableKind if scanner.accept(str(kind))), None)
    index = None if kind is None else scanner.take_integer()
    if kind is None or index is None:
        scanner.reset(start)
        return None
    if scanner.peek(".-"):
        raise scanner.refusal("not here")
    if not scanner.accept("="):
        return values.reporting(kind, index)
    value = parse_expression(scanner) if kind in _MAY_SET else None
    if not isinstance(value, Number):
        raise scanner.refusal("not here")
    return values.setting(kind, index, value.value)
