"""The numbered variables of a controller: I, P, Q and M, and which I-variable belongs to whom."""

from __future__ import annotations

import math
from collections.abc import Mapping

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.syntax import VariableKind

HIGHEST_INDEX = 1023
"""I, P, Q and M run from 0 to 1023 on the non-Turbo controller."""


GREATEST_SETTING = 2.0**47
"""An I-variable that is set beyond this, either way, stays there: no register of the card is wider."""


def coordinate_variable(system: int, number: int) -> int:
    """Return the index of Ix`number` of coordinate system x; the same sets as the motors', 85 to 98."""
    return 100 * system + number


MODAL_NUMBERS = (87, 88, 89)
"""Ix87, Ix88, Ix89: TA, TS, and F or TM, as the last program left them."""


class VariableStore:
    """Values by family and number; what was never set reads 0, an undefined M is a plain value.

    `i_revision` changes whenever a setting may have changed, so that what is derived from them can follow; what
    a program keeps in Ix87 to Ix89 from move to move is none.
    """

    def __init__(self, i_variables: Mapping[int, float] | None = None) -> None:
        self.i_revision = 0
        self._i: dict[int, float] = dict(i_variables or {})
        self._p: dict[int, float] = {}
        self._q: dict[int, float] = {}
        self._m: dict[int, float] = {}

    def get(self, kind: VariableKind, index: int) -> float:
        """Return a value.

        Raises:
            PmacError: 003, no such variable.
        """
        # P first and without a call: a program reads some thousands of them a second.
        value = self._p.get(index) if kind is VariableKind.P else self._table(kind).get(index)
        if value is None:
            _check(kind, index)
            return 0.0
        return value

    def set(self, kind: VariableKind, index: int, value: float) -> None:
        """Store a value.

        Raises:
            PmacError: 003, no such variable.
        """
        _check(kind, index)
        if kind is VariableKind.I:
            value = max(-GREATEST_SETTING, min(value, GREATEST_SETTING))
            if index % 100 not in MODAL_NUMBERS:
                self.i_revision += 1
        self._table(kind)[index] = value

    def i(self, index: int) -> float:
        """Return an I-variable."""
        return self._i.get(index, 0.0)

    def motor(self, motor: int, number: int) -> float:
        """Return Ix`number` of a motor."""
        return self._i.get(100 * motor + number, 0.0)

    def blend_ms(self, system: int, number: int) -> float:
        """Return Ix87 (TA) or Ix88 (TS) of a coordinate system as the card takes it: whole ms, never negative."""
        return float(max(0, math.floor(self.i(coordinate_variable(system, number)) + 0.5)))

    def replace_i(self, values: Mapping[int, float]) -> None:
        """Put a whole set of I-variables in the place of the present one (a reset)."""
        self._i = dict(values)
        self.i_revision += 1

    def _table(self, kind: VariableKind) -> dict[int, float]:
        if kind is VariableKind.P:
            return self._p
        if kind is VariableKind.M:
            return self._m
        return self._i if kind is VariableKind.I else self._q


def _check(kind: VariableKind, index: int) -> None:
    if not 0 <= index <= HIGHEST_INDEX:
        raise PmacError(ErrorCode.DATA_ERROR, f"{kind}{index} does not exist; 0 to {HIGHEST_INDEX}")
