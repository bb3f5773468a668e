"""Samples of data gathering as a controller stores them."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.pmac.gathering.gather import encode_float, long_words_of, padding_of, shifts_of
from drivers.pmac.memory import Pointer


def pack(sources: Sequence[Pointer], values: Sequence[float]) -> list[int]:
    """Make a sample as a controller stores it."""
    sample = padding_of(sources)
    for source, value, shift in zip(sources, values, shifts_of(sources), strict=True):
        mask = 2**24 - 1 if source.space in "XY" else 2**48 - 1
        sample |= (encode_float(value) if source.space == "L" else int(value) & mask) << shift
    return [sample >> 48 * place & 2**48 - 1 for place in range(long_words_of(sources))]
