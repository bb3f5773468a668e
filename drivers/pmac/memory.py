"""M-variable definitions: which bits of which memory word of the controller an M-variable stands for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import parse_number
from drivers.pmac.language.lexer import Scanner

WORD_BITS = 24

SHORT_SPACES = ("X", "Y")
LONG_SPACES = ("D", "L", "DP", "F")
MULTIPLEXED_SPACES = ("TWB", "TWD", "TWR", "TWS")

WIDTHS = (1, 4, 8, 12, 16, 20, 24)  # The permitted widths of an M-variable's bit field
WHOLE_WORD = 24  # Given as an offset, it selects all bits

HIGHEST_MULTIPLEXED = 255

SPACES = (*SHORT_SPACES, *LONG_SPACES, *MULTIPLEXED_SPACES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pointer:
    """`M1->Y:$C0,0,24,S`: `space` X, Y, D (48 bits fixed), L (48 bits floating), DP, F, TWB, TWD, TWR or TWS.

    `offset` and `width` are in bits for X and Y; for TWB and TWD as their accessories count them. A width of 24 at
    offset 0 is the whole word. TWR has only an offset, TWS neither.
    """

    space: str
    address: int
    offset: int = 0
    width: int = 24
    signed: bool = False

    def __str__(self) -> str:
        if self.space in LONG_SPACES:
            return f"{self.space}:${self.address:X}"
        sign = ",S" if self.signed else ""
        if self.space in SHORT_SPACES:
            if self.width == WORD_BITS:
                return f"{self.space}:${self.address:X},{WHOLE_WORD}{sign}"
            width = f",{self.width}" if self.width != 1 or self.signed else ""
            return f"{self.space}:${self.address:X},{self.offset}{width}{sign}"
        if self.space == "TWS":
            return f"TWS:{self.address}"
        if self.space == "TWR":
            return f"TWR:{self.address},{self.offset}"
        return f"{self.space}:{self.address},{self.offset},{self.width}{sign}"


@dataclass(frozen=True, slots=True)
class PassingWord:
    """A word that belongs to a motor and holds a number: its present value, and those of the last stretch.

    `passed` has a value for each servo cycle of the stretch through which the motor was run last. The word holds
    the nearest integer to a value, halves up, and 0 for one that is not finite.
    """

    motor: int
    now: Callable[[], float]
    passed: Callable[[], list[float]]


class Memory(Protocol):
    """The memory words that M-variables access."""

    def read(self, pointer: Pointer) -> float:
        """Return the value that a definition points at."""

    def write(self, pointer: Pointer, value: float) -> None:
        """Store a value; non-integers are rounded, bits that do not fit are lost."""

    def bits_of(self, pointer: Pointer) -> Callable[[], int] | None:
        """Return a quick way to read the bits of a D word again and again; None: there is none."""

    def passing(self, pointer: Pointer) -> PassingWord | None:
        """Return how to read a word in each servo cycle of a stretch; None: only in each cycle by itself."""


def scan_pointer(scanner: Scanner, highest_address: int) -> Pointer | None:
    """Parse what follows `M1->`: a definition, or `*`, which points at nothing (None).

    Raises PmacError: 003, not a definition, or an invalid address, offset or width.
    """
    if scanner.accept("*"):
        return None
    space = scanner.take_word(SPACES)
    if space is None:
        raise scanner.refusal("a definition as in M1->Y:$C0,8,4")
    scanner.accept(":")
    address = parse_number(scanner, 0, HIGHEST_MULTIPLEXED if space in MULTIPLEXED_SPACES else highest_address)
    if space in LONG_SPACES or space == "TWS":
        return Pointer(space=space, address=address)
    if space in SHORT_SPACES:
        return _part_of_word(scanner, space, address)
    scanner.expect(",")
    offset = parse_number(scanner, 0, 7)
    if space == "TWR":
        return Pointer(space=space, address=address, offset=offset)
    scanner.expect(",")
    width = parse_number(scanner, 0, 32)
    return Pointer(space=space, address=address, offset=offset, width=width, signed=_read_sign(scanner))


def _part_of_word(scanner: Scanner, space: str, address: int) -> Pointer:
    scanner.expect(",")
    offset, width = parse_number(scanner, 0, WHOLE_WORD), 1
    mark = scanner.mark()
    if scanner.accept(","):
        given = scanner.take_integer()
        if given is None:
            scanner.reset(mark)
        else:
            width = given
    if offset == WHOLE_WORD:
        offset, width = 0, WORD_BITS
    if width not in WIDTHS or offset + width > WORD_BITS:
        raise PmacError(ErrorCode.DATA_ERROR, f"{width} bits from bit {offset} of a word of {WORD_BITS}")
    return Pointer(space=space, address=address, offset=offset, width=width, signed=_read_sign(scanner))


def _read_sign(scanner: Scanner) -> bool:
    if not scanner.accept(","):
        return False
    if scanner.accept("S"):
        return True
    scanner.expect("U")
    return False
