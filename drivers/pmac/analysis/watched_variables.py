"""Variables that record what a walked program sets. Compiled with those that they extend."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drivers.pmac.dialect import Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.variables import MODAL_NUMBERS, VariableStore

COMPENSATION = 51  # I51 switches the compensation tables


class WatchedVariables(VariableStore):
    """Records what a program has set, except the modal times, which do not define its state.

    `on_compensation` is called when I51 goes on or off.
    """

    def __init__(self, i_variables: Mapping[int, float], dialect: Dialect) -> None:
        super().__init__(i_variables, dialect)
        self.written: dict[tuple[VariableKind, int, int], float] = {}
        self.on_compensation: Callable[[bool], None] | None = None

    @property
    def p_values(self) -> list[float] | None:
        """Nothing: each assignment is recorded."""
        return None

    def set(self, kind: VariableKind, index: int, value: float, system: int = 1) -> None:
        """Store a value, see `VariableStore.set`."""
        before = self.i(COMPENSATION)
        super().set(kind, index, value, system)
        after = self.i(COMPENSATION)
        if after != before and self.on_compensation is not None:
            self.on_compensation(after != 0.0)
        if kind is not VariableKind.I or index % 100 not in MODAL_NUMBERS:
            self.written[kind, index, system] = value
