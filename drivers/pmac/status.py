"""Status words of motors, coordinate systems and the whole controller, from a dialect's tables of named bits.

One table serves both sides: the simulator packs with it and the client decodes with it. Words are 24 bits, sent as
hexadecimal digits, most significant first (PMAC Software Reference, `?`, `??`, `???`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

BITS_PER_WORD = 24
MOST_SHOWN = 40  # characters of a reply that an error names
_HEXADECIMAL = re.compile(r"[0-9A-Fa-f]+")

BitTable = Mapping[str, tuple[int, int]]  # Name of a bit to (word counted from 1, bit)


def bit_table(runs: Mapping[tuple[int, int], str]) -> dict[str, tuple[int, int]]:
    """Return a table from runs of names: by word and highest bit, the names of the bits from there down."""
    return {
        name: (word, highest - place)
        for (word, highest), names in runs.items()
        for place, name in enumerate(names.split())
    }


def pack(conditions: Mapping[str, bool], table: BitTable, words: int = 2) -> tuple[int, ...]:
    """Return the words with the bits of the true conditions set.

    Conditions that a table has no bit for are left out: not every family reports everything.
    """
    packed = [0] * words
    for name, holds in conditions.items():
        if holds and name in table:
            word, bit = table[name]
            packed[word - 1] |= 1 << bit
    return tuple(packed)


def digits_of(words: Iterable[int]) -> str:
    """Return the hexadecimal digits of status words."""
    return "".join(f"{word:06X}" for word in words)


def decode(digits: str, table: BitTable) -> frozenset[str]:
    """Return the names of the bits that are set.

    Raises ValueError: not hexadecimal, or too short for the table.
    """
    if not _HEXADECIMAL.fullmatch(digits):  # int() takes a space, a sign and an underscore, too
        raise ValueError(digits[:MOST_SHOWN])
    per_word = BITS_PER_WORD // 4
    words = [int(digits[start : start + per_word], 16) for start in range(0, len(digits), per_word)]
    needed = max(word for word, _ in table.values())
    if len(words) < needed or len(digits) % per_word:
        raise ValueError(f"status of {len(digits)} digits, {needed * per_word} are needed")
    return frozenset(name for name, (word, bit) in table.items() if words[word - 1] >> bit & 1)
