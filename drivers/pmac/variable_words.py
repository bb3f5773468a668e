"""Variables and M-variable definitions as words of memory, at the addresses where their family keeps them.

A P- or Q-variable is an L word; those of Q are of coordinate system 1. The definition of an M-variable is a long
word: Y is the address that it points at, X says which bits of which space. So a program can change where an
M-variable points at by writing to memory.
"""

from __future__ import annotations

from dataclasses import replace

from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.memory import SPACES, WIDTHS, WORD_BITS, Pointer
from drivers.pmac.variables import VariableStore

_SPACE_SHIFT, _SIGN_BIT, _OFFSET_SHIFT, _PART = 20, 1 << 19, 8, 0xFF
"""The code in X: the number of the space from 1 (0 is no definition), the sign, the first bit, the width."""


class VariableWords:
    """The words of the variables of one controller."""

    def __init__(self, variables: VariableStore) -> None:
        self._variables = variables
        dialect = variables.dialect
        self._count = dialect.highest_index + 1
        self._first = {VariableKind(kind): first for kind, first in dialect.variable_addresses.items()}
        self._definitions = dialect.definitions_address

    def variable_at(self, address: int) -> tuple[VariableKind, int] | None:
        """Return the P- or Q-variable that an L word is."""
        for kind, first in self._first.items():
            if first <= address < first + self._count:
                return kind, address - first
        return None

    def word(self, space: str, address: int) -> int | None:
        """Return a word of a definition, None when it is none."""
        index = self._index(address)
        if index is None:
            return None
        pointer = self._variables.pointers.get(index)
        if pointer is None:
            return 0
        return pointer.address if space == "Y" else _code(pointer)

    def set_word(self, space: str, address: int, value: int) -> bool:
        """Store a word of a definition; return whether it is one. A code without a meaning changes nothing."""
        index = self._index(address)
        if index is None:
            return False
        pointers = self._variables.pointers
        pointer = pointers.get(index)
        if space == "Y":
            if pointer is not None:
                pointers[index] = replace(pointer, address=value & self._variables.dialect.highest_address)
        elif not value:
            pointers.pop(index, None)
        else:
            made = _pointer(value, 0 if pointer is None else pointer.address)
            if made is not None:
                pointers[index] = made
        return True

    def _index(self, address: int) -> int | None:
        index = address - self._definitions
        return index if 0 <= index < self._count else None


def _code(pointer: Pointer) -> int:
    sign = _SIGN_BIT if pointer.signed else 0
    space = SPACES.index(pointer.space) + 1
    return space << _SPACE_SHIFT | sign | pointer.offset << _OFFSET_SHIFT | pointer.width


def _pointer(code: int, address: int) -> Pointer | None:
    space, offset, width = code >> _SPACE_SHIFT, code >> _OFFSET_SHIFT & _PART, code & _PART
    if not 1 <= space <= len(SPACES) or width not in WIDTHS or offset + width > WORD_BITS:
        return None
    signed = bool(code & _SIGN_BIT)
    return Pointer(space=SPACES[space - 1], address=address, offset=offset, width=width, signed=signed)
