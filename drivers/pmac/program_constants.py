"""The values that a program is downloaded with, as planned and as the controller holds them.

The geometry of a cut is in variables that are set before its program, each by one line: a wrong digit in transit,
or another host, changes the cut without changing the program. So each of them is read back. Whatever reads raises
DriverError when the link breaks or the controller refuses to answer.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from drivers.controller import Controller, query_in_lines
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import number_of
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.text import format_number
from drivers.pmac.memory import Pointer, scan_pointer
from drivers.pmac.program_text import ProgramText
from drivers.pmac.variables import VariableStore
from profiles.problem import Problem

NOT_STARTED = "controller.constant_differs"  # found before a program runs, which is not started then
IN_THE_CUT = "cut.constant_differs"  # found while it runs, which is stopped then
AFTER_IT = "cut.constant_changed"  # found when it has ended
RELATIVE = 1e-8
"""Controllers report variables with some ten digits. A difference after the eighth affects no part: the lobe angle
of one segment, off by so much, is off by 0.02 degrees of lobe after 10,000 segments.
"""

ITEMS_A_LINE = 30
_HIGHEST_ADDRESS = 0xFFFFFF
_POINTER = re.compile(r"(M\d+)->(.+)", re.IGNORECASE)
_WORDS = re.compile(r"W([XY]):\$([0-9A-F]+),(.+)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """A variable that is set before a program: `P11`, and its value.

    `value` is None where it is a copy of what the controller holds in `copied_from`. `kept` is whether it stays
    the same while the program runs and after it has ended: a P-variable that the program does not set itself.
    """

    name: str
    value: float | None
    copied_from: str = ""
    kept: bool = True


def constants_of(program: ProgramText, dialect: Dialect) -> tuple[Constant, ...]:
    """Return the variables that are set before a program, each once, in order.

    Raises PmacError: an expression that cannot be evaluated.
    """
    store, changed = VariableStore(dialect=dialect), find_assigned_variables(program)
    found: dict[str, Constant] = {}
    for statement in (each for line in program.settings for each in line):
        if not isinstance(statement, syntax.Assign):
            continue
        index = int(evaluate(statement.target.index, store))
        name, source = f"{statement.target.kind}{index}", _source(statement.value, found)
        value = None
        if not source:
            value = evaluate(statement.value, store)
            store.set(statement.target.kind, index, value)
        found.pop(name, None)
        kept = statement.target.kind is syntax.VariableKind.P and name not in changed
        found[name] = Constant(name=name, value=value, copied_from=source, kept=kept)
    return tuple(found.values())


def _source(expression: syntax.Expression, known: Mapping[str, Constant]) -> str:
    """Return the controller variable that a value is a copy of, "" for a number of ours."""
    if isinstance(expression, syntax.Variable) and isinstance(expression.index, syntax.Number):
        name = f"{expression.kind}{int(expression.index.value)}"
        return "" if name in known else name
    return ""


def find_assigned_variables(program: ProgramText) -> frozenset[str]:
    """Return the names of the variables that the program itself sets: `P30`."""
    return frozenset(name for name, _ in _assignments(program))


def assigned_numbers(program: ProgramText) -> Mapping[str, frozenset[float]]:
    """Return the numbers that the program itself sets variables to, by name."""
    found: dict[str, frozenset[float]] = {}
    for name, value in _assignments(program):
        if isinstance(value, syntax.Number):
            found[name] = found.get(name, frozenset()) | {value.value}
    return found


def _assignments(program: ProgramText) -> Iterator[tuple[str, syntax.Expression]]:
    texts: Sequence[syntax.Program] = (program.program, *program.subprograms.values())
    for statement in (each for lines in texts for line in lines for each in line):
        if isinstance(statement, syntax.Assign) and isinstance(statement.target.index, syntax.Number):
            yield f"{statement.target.kind}{int(statement.target.index.value)}", statement.value


def read_values(client: Controller, names: Iterable[str]) -> dict[str, float]:
    """Query variables, as many in a line as the controller accepts."""
    asked = list(dict.fromkeys(names))
    texts = query_in_lines(client, asked, ITEMS_A_LINE)
    return {name: client.number(text) for name, text in zip(asked, texts, strict=True)}


def _differing(planned: Mapping[str, float], actual: Mapping[str, float], code: str) -> Iterator[Problem]:
    """Yield the problem of each actual value that is not as planned."""
    for name, value in actual.items():
        if not math.isclose(value, planned[name], rel_tol=RELATIVE, abs_tol=RELATIVE):
            found, limit = format_number(value), format_number(planned[name])
            yield Problem(code=code, key=name, value=found, limit=limit)


def constant_problems(
    client: Controller,
    constants: Sequence[Constant],
    copied: Mapping[str, float] | None = None,
    code: str = NOT_STARTED,
) -> tuple[Problem, ...]:
    """Read constants and compare; one that is a copy is compared with its source, or with what was `copied`."""
    sources = [each.copied_from for each in constants if each.copied_from and copied is None]
    found = read_values(client, (*(each.name for each in constants), *sources))
    if copied is None:
        copied = {each.name: found[each.copied_from] for each in constants if each.copied_from}
    planned = {each.name: copied[each.name] if each.value is None else each.value for each in constants}
    return tuple(_differing(planned, {name: found[name] for name in planned}, code))


def pointers_of(program: ProgramText) -> dict[str, str]:
    """Return the M-variable definitions before a program, by name."""
    return {found[1].upper(): found[2] for text in program.commands if (found := _POINTER.fullmatch(text))}


def pointer_problems(client: Controller, program: ProgramText, code: str = NOT_STARTED) -> Iterator[Problem]:
    """Compare the M-variable definitions before a program with those of the controller."""
    planned = pointers_of(program)
    if not planned:
        return
    reported = client.query(*(f"{name}->" for name in planned), again=True)
    for (name, text), reply in zip(planned.items(), reported, strict=True):
        actual = reply.strip().rpartition("->")[2]  # in any form of I9 (`M169->D:$46`)
        if _pointer(actual) != _pointer(text):
            yield Problem(code=code, key=f"{name}->", value=actual, limit=text)


def word_problems(client: Controller, program: ProgramText) -> Iterator[Problem]:
    """Compare the memory words that are written before a program, such as a conversion table's."""
    for text in program.commands:
        found = _WORDS.fullmatch(text)
        if found is None:
            continue
        planned = [int(number_of(word)) for word in found[3].split(",")]
        place = f"{found[1].upper()}:${found[2].upper()}"
        (actual,) = client.query(f"RH{place},{len(planned)}", again=True)
        if _hexadecimal(actual) != planned:
            limit = " ".join(f"{word:X}" for word in planned)
            yield Problem(code=NOT_STARTED, key=place, value=actual.strip(), limit=limit)


def _pointer(text: str) -> Pointer | str | None:
    try:
        return scan_pointer(Scanner(text), _HIGHEST_ADDRESS)
    except PmacError:
        return text


def _hexadecimal(text: str) -> list[int] | None:
    try:
        return [int(word, 16) for word in text.split()]
    except ValueError:
        return None
