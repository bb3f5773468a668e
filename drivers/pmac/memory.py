"""M-variable definitions: which bits of which memory word of the controller an M-variable stands for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True, kw_only=True)
class Pointer:
    """`M1->Y:$C0,0,24,S`: `space` X, Y, D (48 bits fixed), L (48 bits floating), DP, F, TWB, TWD, TWR or TWS.

    `offset` and `width` in bits, for X and Y only. A width of 24 at offset 0 is the whole word.
    """

    space: str
    address: int
    offset: int = 0
    width: int = 24
    signed: bool = False


class Memory(Protocol):
    """The words behind the M-variables."""

    def read(self, pointer: Pointer) -> float:
        """Return the value that a definition points at."""
        ...

    def write(self, pointer: Pointer, value: float) -> None:
        """Store a value there; non-integers are rounded, the bits that do not fit are lost."""
        ...
