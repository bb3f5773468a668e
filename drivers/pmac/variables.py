"""The numbered variables of a controller: I, P, Q and M, the owner of each I-variable, and their words in memory.

A P- or Q-variable is an L word at the address where its family keeps it; those of Q are of coordinate system 1.
The definition of an M-variable is a long word: Y is the address that it points at, X says which bits of which
space. So a program can change where an M-variable points at by writing to memory.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from drivers.pmac.dialect import PMAC, Dialect, FamilySetting
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.memory import SPACES, WIDTHS, WORD_BITS, Memory, Pointer

GREATEST_SETTING = 2.0**47
"""I-variables saturate here, in either direction: no register of the controller is wider."""

MODAL_NUMBERS = (87, 88, 89)  # Ix87, Ix88, Ix89: TA, TS, and F or TM, as the last program left them


# Naming a member through its class costs more than the look-up of a value, some hundred thousand times a cut.
_I, _P, _Q, _M = VariableKind.I, VariableKind.P, VariableKind.Q, VariableKind.M


class VariableStore:
    """Values by family and number; a variable never set reads 0.

    An M-variable without a definition in `pointers` is a plain value; one with a definition reads and writes
    `memory`. `i_revision` changes whenever a setting may have changed, so that derived values can follow; updates
    of Ix87 to Ix89 by a program from move to move do not count.
    """

    def __init__(self, i_variables: Mapping[int, float] | None = None, dialect: Dialect = PMAC) -> None:
        self.dialect = dialect
        self.i_revision = 0
        self.pointers: dict[int, Pointer] = {}
        self.memory: Memory | None = None
        self._i: dict[int, float] = dict(i_variables or {})
        self._p = [0.0] * (dialect.highest_index + 1)
        self._q: dict[int, dict[int, float]] = {}
        self._m: dict[int, float] = {}
        self._read_only = None if dialect.user_buffer is None else dialect.user_buffer.setting

    def get(self, kind: VariableKind, index: int, system: int = 1) -> float:
        """Return a value; Q-variables are those of a coordinate system.

        Raises PmacError: 003, no such variable.
        """
        # P first and without a call: a program reads some thousands of them a second.
        if kind is _P:
            if not 0 <= index < len(self._p):
                self._check(kind, index)
            return self._p[index]
        if kind is _M and index in self.pointers and self.memory is not None:
            return self.memory.read(self.pointers[index])
        value = self._read(kind, index, system)
        if value is None:
            self._check(kind, index)
            return 0.0
        return value

    def set(self, kind: VariableKind, index: int, value: float, system: int = 1) -> None:
        """Store a value; an I-variable of limited range wraps silently, as on the controller.

        Raises PmacError: 003, no such variable.
        """
        self._check(kind, index)
        if kind is _P:
            self._p[index] = value
        elif kind is _I and index == self._read_only:
            return  # it only reports: an assignment has no effect
        elif kind is _I:
            self._set_i(index, value)
        elif kind is _M and index in self.pointers and self.memory is not None:
            self.memory.write(self.pointers[index], value)
        else:
            self._table(kind, system)[index] = value

    def report(self, index: int, value: float) -> None:
        """Set an I-variable that hosts can only read."""
        self._i[index] = value

    def i(self, index: int) -> float:
        """Return an I-variable."""
        return self._i.get(index, 0.0)

    def motor(self, motor: int, number: int) -> float:
        """Return Ix`number` of a motor."""
        return self._i.get(100 * motor + number, 0.0)

    def system(self, system: int, number: int) -> float:
        """Return Ix`number` of a coordinate system."""
        return self._i.get(self.dialect.system_index(system, number), 0.0)

    def setting(self, setting: FamilySetting, owner: int = 1) -> float:
        """Return a setting whose number depends on the family; `owner` is a motor or a system."""
        return self._i.get(self.dialect.index(setting, owner), 0.0)

    def blend_ms(self, system: int, number: int) -> float:
        """Return Ix87 (TA) or Ix88 (TS) of a coordinate system as the controller uses it: whole ms, at least 0."""
        return float(max(0, math.floor(self.system(system, number) + 0.5)))

    def view(self, system: int) -> SystemVariables:
        """Return the variables as seen by a program or host that addresses a coordinate system."""
        return SystemVariables(self, system)

    @property
    def p_values(self) -> list[float] | None:
        """The P-variables by number, to be read and written as they are; None where each `set` is watched."""
        return self._p

    def settings(self) -> dict[int, float]:
        """Return every I-variable that was ever set, by number (to save them)."""
        return dict(self._i)

    def replace_i(self, values: Mapping[int, float]) -> None:
        """Replace the whole set of I-variables (a reset)."""
        self._i = dict(values)
        self.i_revision += 1

    def _set_i(self, index: int, value: float) -> None:
        value = max(-GREATEST_SETTING, min(value, GREATEST_SETTING))
        limits = self.dialect.ranges.get(index)
        if limits is not None:
            lowest, count = limits
            value = float(lowest + (math.floor(value + 0.5) - lowest) % count)
        elif index in self.dialect.fractions:
            ones = 2.0 ** self.dialect.fractions[index]
            value = float((math.floor(value * ones + 0.5) + 2**23) % 2**24 - 2**23) / ones
        # Where systems have numbers of their own, a motor's Ixx88 is a setting like any other.
        modal = index % 100 in MODAL_NUMBERS and index >= self.dialect.system_offset
        if not modal and value != self._i.get(index):
            self.i_revision += 1
        self._i[index] = value

    def _read(self, kind: VariableKind, index: int, system: int) -> float | None:
        return self._table(kind, system).get(index)

    def _table(self, kind: VariableKind, system: int) -> dict[int, float]:
        if kind is _Q:
            return self._q.setdefault(system, {})
        return self._i if kind is _I else self._m

    def _check(self, kind: VariableKind, index: int) -> None:
        if not 0 <= index <= self.dialect.highest_index:
            highest = self.dialect.highest_index
            raise PmacError(ErrorCode.DATA_ERROR, f"{kind}{index} does not exist; 0 to {highest}")


class SystemVariables:
    """The variables with the Q-variables of one coordinate system."""

    def __init__(self, store: VariableStore, system: int) -> None:
        self.store = store
        self.number = system

    def get(self, kind: VariableKind, index: int) -> float:
        """Return a value, see `VariableStore.get`."""
        return self.store.get(kind, index, self.number)

    def set(self, kind: VariableKind, index: int, value: float) -> None:
        """Store a value, see `VariableStore.set`."""
        self.store.set(kind, index, value, self.number)


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
