"""Common parts of several statements: lists of letters and of numbers, axis words, program buffers."""

from __future__ import annotations

import re
from collections.abc import Callable

from drivers.pmac.language.expressions import at_data, parse_data
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import AxisWord, Statement

Reader = Callable[[Scanner, str], Statement | None]
"""Parses what follows its word; None when that does not make a statement."""

HIGHEST_PROGRAM = 32_767
HIGHEST_PLC = 31

PROGRAM = ("PROGRAM", "PROG")
OPEN_PROGRAM = tuple(f"OPEN{word}" for word in PROGRAM)
OPEN_PLC = ("OPENPLC",)
CLEAR = ("CLEAR", "CLR")
CLOSE = ("CLOSE", "CLS")

_SPACES = r"\s*"
TRAILING_CLOSE = re.compile(f"(?:{'|'.join(map(_SPACES.join, CLOSE))}){_SPACES}$", re.IGNORECASE)
"""CLOSE at the end of a stored line; white space may be anywhere in it."""


def parse_letters(scanner: Scanner, letters: tuple[str, ...]) -> tuple[str, ...]:
    """Parse `(X,Y)`, each one of `letters`.

    Raises:
        PmacError: 003, something else is there.
    """
    scanner.expect("(")
    listed = [_letter(scanner, letters)]
    while scanner.accept(","):
        listed.append(_letter(scanner, letters))
    scanner.expect(")")
    return tuple(listed)


def parse_numbers(scanner: Scanner, lowest: int, highest: int) -> tuple[int, ...]:
    """Parse `1..3,5`, each number from `lowest` to `highest`; a range stands for all its numbers.

    Raises:
        PmacError: 003, not a number, or one outside the limits.
    """
    listed = list(_range(scanner, lowest, highest))
    while scanner.accept(","):
        listed += _range(scanner, lowest, highest)
    return tuple(listed)


def parse_words(scanner: Scanner, letters: tuple[str, ...]) -> tuple[AxisWord, ...]:
    """Parse axis words as long as they follow one another and no letter is repeated; perhaps none."""
    words: dict[str, AxisWord] = {}
    while True:
        mark = scanner.mark()
        letter = scanner.take_word(letters)
        if letter is None or letter in words or not at_data(scanner):
            scanner.reset(mark)
            return tuple(words.values())
        words[letter] = AxisWord(letter, parse_data(scanner))


def _letter(scanner: Scanner, letters: tuple[str, ...]) -> str:
    letter = scanner.take_word(letters)
    if letter is None:
        raise scanner.refusal(f"expected one of {' '.join(letters)}")
    return letter


def _range(scanner: Scanner, lowest: int, highest: int) -> range:
    first = _number(scanner, lowest, highest)
    last = _number(scanner, first, highest) if scanner.accept("..") else first
    return range(first, last + 1)


def _number(scanner: Scanner, lowest: int, highest: int) -> int:
    number = scanner.take_integer()
    if number is None or not lowest <= number <= highest:
        raise scanner.refusal(f"expected a number from {lowest} to {highest}")
    return number
