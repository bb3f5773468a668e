"""Query and set variables, point M-variables at memory, and read and write its words (`RHY:$720,16`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import parse_expression
from drivers.pmac.language.lexer import Scanner, longest_of
from drivers.pmac.language.syntax import Number, VariableKind
from drivers.pmac.language.text import format_number
from drivers.pmac.memory import WORD_BITS, Memory, Pointer, scan_pointer
from drivers.simulator.context import Context, Handler, LineContext, Step, signed_constant

_KINDS = {str(kind): kind for kind in VariableKind}
_KIND = longest_of(tuple(_KINDS))
_DEFINITION = re.compile(r"\*|(?:[XYLF]|DP?|TW[BDRS])[:$\d]")
_HEXADECIMAL = 2  # bit 1 of I9
MOST_WORDS = 256  # maximum words read by one command
_WORD_WORK = 3  # cost of a word, in variables read
ADDRESS_STARTS = ":$0123456789"
_SPACES = {"X": WORD_BITS, "Y": WORD_BITS, "D": 2 * WORD_BITS, "P": WORD_BITS, "L": 0}
"""Widths, bits; L is a number, P the memory of the program."""


def variable(scanner: Scanner, reading: LineContext) -> Step | None:
    """Report or assign `P1`, `P1..3`, `P1,3,2`, `P(P1+1)`, `I130=*`, `M1->...`; None when it is none of these.

    Raises PmacError: 003, no such variable, range or value.
    """
    start = scanner.mark()
    word = scanner.take(_KIND)
    first = scanner.take_integer() if word is not None else None
    if word is None or (first is None and not scanner.peek("(")):
        scanner.reset(start)
        return None
    kind = _KINDS[word]
    indices = (
        _read_computed_index(scanner)
        if first is None
        else _constant(_indices(scanner, first, reading), kind, reading)
    )
    if kind is VariableKind.M and scanner.peek("-"):
        if reading.text[scanner.position - 1].isspace():
            # The arrow comes directly after the number (Software Reference, M->).
            raise scanner.refusal("no space in front of -> as in M1->*")
        scanner.expect("->")
        return _point(scanner, indices, reading)
    if scanner.accept("="):
        return _assign(scanner, kind, indices)

    def report(context: Context) -> None:
        which = indices(context)
        context.work += len(which)
        context.lines.extend(_report_values(context, kind, which))

    return report


_Indices = Callable[[Context], range]


def _constant(indices: range, kind: VariableKind, reading: LineContext) -> _Indices:
    if indices[-1] > reading.dialect.highest_index:
        highest = reading.dialect.highest_index
        raise PmacError(ErrorCode.DATA_ERROR, f"{kind}{indices[-1]} does not exist; 0 to {highest}")
    return lambda context: indices


def _read_computed_index(scanner: Scanner) -> _Indices:
    """`(P1+1)`: one variable, whose number is found when the command acts."""
    scanner.expect("(")
    expression = parse_expression(scanner)
    scanner.expect(")")

    def indices(context: Context) -> range:
        index, highest = int(context.value(expression)), context.dialect.highest_index
        if not 0 <= index <= highest:
            raise PmacError(ErrorCode.DATA_ERROR, f"number {index}, 0 to {highest}")
        return range(index, index + 1)

    return indices


def _indices(scanner: Scanner, first: int, reading: LineContext) -> range:
    most = reading.dialect.highest_index + 1
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


def _assign(scanner: Scanner, kind: VariableKind, indices: _Indices) -> Step:
    factory = kind is VariableKind.I and scanner.accept("*")
    expression = Number(0.0) if factory else parse_expression(scanner)

    def step(context: Context) -> None:
        which, variables = indices(context), context.variables
        context.work += len(which)
        if factory:
            for index in which:
                variables.set(kind, index, context.dialect.factory.get(index, 0.0))
            return
        value = context.value(expression)
        for index in which:
            variables.set(kind, index, value)

    return step


def _report_values(context: Context, kind: VariableKind, indices: range) -> Iterator[str]:
    variables, setting = context.variables, kind is VariableKind.I
    in_full = setting and context.in_full
    hexadecimal = setting and int(context.controller.variables.i(9)) & _HEXADECIMAL
    addresses = context.dialect.hexadecimal if hexadecimal else ()
    for index in indices:
        value = variables.get(kind, index)
        if index in addresses and value >= 0 and value == int(value):
            text = f"${int(value):X}"
        else:
            text = format_number(value)
        yield f"I{index}={text}" if in_full else text


def _point(scanner: Scanner, indices: _Indices, reading: LineContext) -> Step:
    if not _DEFINITION.match(scanner.rest):
        return lambda context: _list_pointers(context, indices(context))
    pointer = scan_pointer(scanner, reading.dialect.highest_address)

    def step(context: Context) -> None:
        pointers, which = context.controller.variables.pointers, indices(context)
        context.work += len(which)
        for index in which:
            if pointer is None:
                pointers.pop(index, None)
            else:
                pointers[index] = pointer

    return step


def _list_pointers(context: Context, indices: range) -> None:
    store, in_full = context.controller.variables, context.in_full
    context.work += len(indices)
    for index in indices:
        text = str(store.pointers.get(index, "*"))
        context.lines.append(f"M{index}->{text}" if in_full else text)


def _read_words(space: str, hexadecimal: bool) -> Handler:
    bits = _SPACES[space]

    def command(scanner: Scanner, reading: LineContext) -> Step:
        first = _address(scanner)
        count = scanner.take_integer() if scanner.accept(",") else 1
        if not count or count > MOST_WORDS:
            raise scanner.refusal(f"a number of words, 1 to {MOST_WORDS}")
        words = [_pointer(space, address, reading) for address in range(first, first + count)]

        def step(context: Context) -> None:
            context.work += count * _WORD_WORK
            values = [_memory(context).read(word) for word in words]
            if hexadecimal and bits:
                texts = [f"{int(value) & (1 << bits) - 1:0{bits // 4}X}" for value in values]
            else:
                texts = [format_number(value) for value in values]
            context.lines.append(" ".join(texts))

        return step

    return command


def _write_words(space: str) -> Handler:
    def command(scanner: Scanner, reading: LineContext) -> Step:
        address = _address(scanner)
        values: list[tuple[Pointer, float]] = []
        while scanner.accept(","):
            value = signed_constant(scanner)
            if value is None:
                raise scanner.refusal("a value as in WY:$720,$C000")
            values.append((_pointer(space, address + len(values), reading), value))
        if not values:
            raise scanner.refusal("a value as in WY:$720,$C000")

        def step(context: Context) -> None:
            context.work += len(values) * _WORD_WORK
            for pointer, value in values:
                _memory(context).write(pointer, value)

        return step

    return command


def _address(scanner: Scanner) -> int:
    scanner.accept(":")
    address = scanner.take_integer()
    if address is None:
        raise scanner.refusal("an address as in RX:$3D")
    return address


def _pointer(space: str, address: int, reading: LineContext) -> Pointer:
    highest = reading.dialect.highest_address
    if address > highest:
        raise PmacError(ErrorCode.DATA_ERROR, f"address ${address:X}, up to ${highest:X}")
    return Pointer(space=space, address=address)


def _memory(context: Context) -> Memory:
    memory = context.controller.variables.memory
    if memory is None:
        raise PmacError(ErrorCode.DATA_ERROR, "this card has no memory")
    return memory


WORDS: dict[str, Handler] = {
    **{f"R{space}": _read_words(space, hexadecimal=False) for space in _SPACES},
    **{f"RH{space}": _read_words(space, hexadecimal=True) for space in _SPACES},
    **{f"W{space}": _write_words(space) for space in _SPACES},
}
