"""Converted positions: what the encoder conversion table makes of an encoder, once each servo cycle.

A register of 24 bits, five of them fraction, that rolls over. Sources: PMAC User Manual, encoder conversion table;
Turbo Software Reference, I8000.
"""

from __future__ import annotations

from drivers.pmac.memory import WORD_BITS

COUNT_PARTS = 32
"""The parts of a count that five bits of fraction tell apart."""


def parts_of(counts: float) -> int:
    """Return the whole 1/32 that a position in counts has reached."""
    return int(counts * COUNT_PARTS // 1)


def register_change(new: int, old: int) -> int:
    """Return how far the register went, the shorter way round, 1/32 count."""
    half = 1 << (WORD_BITS - 1)
    return (new - old + half) % (1 << WORD_BITS) - half
