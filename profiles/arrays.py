"""The two kinds of arrays that the numbers are computed with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def floats(values: ArrayLike) -> Floats:
    """Return the values as an array of floats."""
    return np.asarray(values, dtype=np.float64)


def complexes(values: ArrayLike) -> Complexes:
    """Return the values as an array of complex numbers."""
    return np.asarray(values, dtype=np.complex128)


def read_only(values: ArrayLike) -> Floats:
    """Return a copy that cannot be changed."""
    copied = np.array(values, dtype=np.float64)
    copied.setflags(write=False)
    return copied
