"""Query and set variables, and point M-variables at memory."""

from __future__ import annotations

import re
from collections.abc import Iterator

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.language.text import format_number
from drivers.pmac.memory import scan_pointer
from drivers.simulator.context import Context

_KINDS = tuple(str(kind) for kind in VariableKind)

_DEFINITION = re.compile(r"\*|(?:[XYLF]|DP?|TW[BDRS])[:$\d]")

_LONG, _HEXADECIMAL = 1, 2
"""Bits of I9."""


def variable(scanner: Scanner, context: Context) -> bool:
    """Report or assign `P1`, `P1..3`, `P1,3,2`, `I130=*`, `M1->...`; False when there is none at the cursor.

    Raises:
        PmacError: 003, no such variable, range or value.
    """
    start = scanner.mark()
    word = scanner.take_word(_KINDS)
    first = scanner.take_integer() if word is not None else None
    if word is None or (first is None and not (word != "P" and scanner.peek("("))):
        scanner.reset(start)
        return False
    kind = VariableKind(word)
    if first is None:
        scanner.expect("(")
        first = int(context.expression(scanner))
        scanner.expect(")")
    indices = _indices(scanner, first, context)
    context.work += len(indices)
    if kind is VariableKind.M and scanner.peek("-"):
        _refuse_gap(scanner, context)
        scanner.expect("->")
        _define(scanner, context, indices)
    elif scanner.accept("="):
        _assign(scanner, context, kind, indices)
    else:
        context.lines.extend(_reported(context, kind, indices))
    return True


def _indices(scanner: Scanner, first: int, context: Context) -> range:
    most = context.dialect.highest_index + 1
    if scanner.accept(".."):
        last = scanner.take_integer()
        if last is None or last < first or last - first >= most:
            raise scanner.refusal("a range as in P1..3")
        return range(first, last + 1)
    if not scanner.accept(","):
        return range(first, first + 1)
    count = scanner.take_integer()
    step = scanner.take_integer() if scanner.accept(",") else 1
    if not count or not step or count > most:
        raise scanner.refusal("start, count, step as in P1,3,2")
    return range(first, first + count * step, step)


def _assign(scanner: Scanner, context: Context, kind: VariableKind, indices: range) -> None:
    variables = context.variables
    if kind is VariableKind.I and scanner.accept("*"):
        factory = context.dialect.factory
        for index in indices:
            variables.set(kind, index, factory.get(index, 0.0))
        return
    value = context.expression(scanner)
    for index in indices:
        variables.set(kind, index, value)


def _reported(context: Context, kind: VariableKind, indices: range) -> Iterator[str]:
    variables = context.variables
    form = int(context.controller.variables.i(9)) if kind is VariableKind.I else 0
    addresses = context.dialect.hexadecimal if form & _HEXADECIMAL else ()
    for index in indices:
        value = variables.get(kind, index)
        if index in addresses and value >= 0 and value == int(value):
            text = f"${int(value):X}"
        else:
            text = format_number(value)
        yield f"I{index}={text}" if form & _LONG else text


def _refuse_gap(scanner: Scanner, context: Context) -> None:
    """Require the arrow of a definition directly after the number (Software Reference, M->)."""
    if context.text[scanner.position - 1].isspace():
        raise scanner.refusal("no space in front of -> as in M1->*")


def _define(scanner: Scanner, context: Context, indices: range) -> None:
    """Set, or report, M-variable definitions."""
    store = context.controller.variables
    if not _DEFINITION.match(scanner.rest):
        long = int(store.i(9)) & _LONG
        for index in indices:
            text = str(store.pointers.get(index, "*"))
            context.lines.append(f"M{index}->{text}" if long else text)
        return
    pointer = scan_pointer(scanner, context.dialect.highest_address)
    if indices[-1] > context.dialect.highest_index:
        raise PmacError(ErrorCode.DATA_ERROR, f"M{indices[-1]} does not exist")
    for index in indices:
        if pointer is None:
            store.pointers.pop(index, None)
        else:
            store.pointers[index] = pointer
