"""Query and set variables, point M-variables at memory, and read and write its words (`RHY:$720,16`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner, longest_of
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.language.text import format_number
from drivers.pmac.memory import WORD_BITS, Memory, Pointer, scan_pointer
from drivers.simulator.context import Context, Handler, signed_constant

_KINDS = {str(kind): kind for kind in VariableKind}
_KIND = longest_of(tuple(_KINDS))
_DEFINITION = re.compile(r"\*|(?:[XYLF]|DP?|TW[BDRS])[:$\d]")
_LONG, _HEXADECIMAL = 1, 2  # bits of I9
MOST_WORDS = 256  # maximum words read by one command
_WORD_WORK = 3  # cost of a word, in variables read
ADDRESS_STARTS = ":$0123456789"
_SPACES = {"X": WORD_BITS, "Y": WORD_BITS, "D": 2 * WORD_BITS, "L": 0}  # widths, bits; L is a number


def variable(scanner: Scanner, context: Context) -> bool:
    """Report or assign `P1`, `P1..3`, `P1,3,2`, `I130=*`, `M1->...`; False when there is none at the cursor.

    Raises PmacError: 003, no such variable, range or value.
    """
    start = scanner.mark()
    word = scanner.take(_KIND)
    first = scanner.take_integer() if word is not None else None
    if word is None or (first is None and not (word != "P" and scanner.peek("("))):
        scanner.reset(start)
        return False
    kind = _KINDS[word]
    if first is None:
        scanner.expect("(")
        first = int(context.expression(scanner))
        scanner.expect(")")
    indices = _indices(scanner, first, context)
    context.work += len(indices)
    if kind is VariableKind.M and scanner.peek("-"):
        if context.text[scanner.position - 1].isspace():
            # The arrow comes directly after the number (Software Reference, M->).
            raise scanner.refusal("no space in front of -> as in M1->*")
        scanner.expect("->")
        _point(scanner, context, indices)
    elif scanner.accept("="):
        _assign(scanner, context, kind, indices)
    else:
        context.lines.extend(_reported(context, kind, indices))
    return True


def reporting(kind: VariableKind, index: int) -> Callable[[Context], None]:
    """Return the command that reports one variable, as `variable` does it."""
    indices = range(index, index + 1)

    def command(context: Context) -> None:
        context.work += 1
        context.lines.extend(_reported(context, kind, indices))

    return command


def setting(kind: VariableKind, index: int, value: float) -> Callable[[Context], None]:
    """Return the command that sets one variable to a constant, as `variable` does it."""

    def command(context: Context) -> None:
        context.work += 1
        context.variables.set(kind, index, value)

    return command


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


def _point(scanner: Scanner, context: Context, indices: range) -> None:
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


def _read_words(space: str, hexadecimal: bool) -> Handler:
    def command(scanner: Scanner, context: Context) -> None:
        first = _address(scanner, context)
        count = scanner.take_integer() if scanner.accept(",") else 1
        if not count or count > MOST_WORDS:
            raise scanner.refusal(f"a number of words, 1 to {MOST_WORDS}")
        context.work += count * _WORD_WORK
        words = (_pointer(space, address, context) for address in range(first, first + count))
        values = [_memory(context).read(word) for word in words]
        bits = _SPACES[space]
        if hexadecimal and bits:
            texts = [f"{int(value) & (1 << bits) - 1:0{bits // 4}X}" for value in values]
        else:
            texts = [format_number(value) for value in values]
        context.lines.append(" ".join(texts))

    return command


def _write_words(space: str) -> Handler:
    def command(scanner: Scanner, context: Context) -> None:
        address = _address(scanner, context)
        values: list[tuple[Pointer, float]] = []
        while scanner.accept(","):
            value = signed_constant(scanner)
            if value is None:
                raise scanner.refusal("a value as in WY:$720,$C000")
            values.append((_pointer(space, address + len(values), context), value))
        if not values:
            raise scanner.refusal("a value as in WY:$720,$C000")
        context.work += len(values) * _WORD_WORK
        for pointer, value in values:
            _memory(context).write(pointer, value)

    return command


def _address(scanner: Scanner, context: Context) -> int:
    scanner.accept(":")
    address = scanner.take_integer()
    if address is None:
        raise scanner.refusal("an address as in RX:$3D")
    return address


def _pointer(space: str, address: int, context: Context) -> Pointer:
    highest = context.dialect.highest_address
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
