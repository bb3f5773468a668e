"""Read and write memory words: `RX:$3D`, `RHY:$720,16`, `WY:$720,$C000,$C004`."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.text import format_number
from drivers.pmac.memory import WORD_BITS, Memory, Pointer
from drivers.simulator.commands.handler import Handler, signed_constant
from drivers.simulator.context import Context

MOST_WORDS = 256
"""Maximum words read by one command."""

_WORD_WORK = 3
"""Cost of a word, in variables read."""

ADDRESS_STARTS = ":$0123456789"

_SPACES = {"X": WORD_BITS, "Y": WORD_BITS, "D": 2 * WORD_BITS, "L": 0}
"""The kinds of words and their width in bits; L is a number."""


def _read(space: str, hexadecimal: bool) -> Handler:
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


def _write(space: str) -> Handler:
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
    **{f"R{space}": _read(space, hexadecimal=False) for space in _SPACES},
    **{f"RH{space}": _read(space, hexadecimal=True) for space in _SPACES},
    **{f"W{space}": _write(space) for space in _SPACES},
}
