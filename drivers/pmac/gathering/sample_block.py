"""Samples that are gathered but not packed yet: numbers by source, packed many at a time when somebody looks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

MOST_WAITING = 1000
"""Samples; they are then packed without being asked for, so that memory does not grow."""

_EXACT = 2.0**62  # counts of this size and more do not fit in the integers of numpy
_MASK = (1 << 48) - 1  # no register is wider
_BYTES = 8


def packed(columns: Sequence[Sequence[float]], widths: Sequence[int], tail: bytes) -> bytes:
    """Return samples as bytes, little-endian: of each source its register in so many bytes, then `tail`.

    A register holds the nearest integer, halves up, 0 for what is not finite.
    """
    samples = np.empty((len(columns[0]), sum(widths) + len(tail)), np.uint8)
    at = 0
    for column, width in zip(columns, widths, strict=True):
        samples[:, at : at + width] = _registers(column)[:, :width]
        at += width
    samples[:, at:] = np.frombuffer(tail, np.uint8)
    return samples.tobytes()


def _registers(values: Sequence[float]) -> NDArray[np.uint8]:
    whole = np.floor(np.array(values, np.float64) + 0.5)
    if (np.abs(whole) < _EXACT).all():
        words = whole.astype("<i8")
    else:  # too large, or not finite
        words = np.array([math.floor(v + 0.5) & _MASK if math.isfinite(v) else 0 for v in values], "<i8")
    return words.view(np.uint8).reshape(-1, _BYTES)
