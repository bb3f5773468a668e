"""Find measurements that do not belong to the others."""

from __future__ import annotations

import numpy as np

from profiles.arrays import Floats
from profiles.confidence import CONFIDENCE, student
from profiles.least_squares import cofactors

ROUNDING = 1e-9
"""Fraction of the largest measurement below which residuals are rounding and are not judged."""


def outliers(design: Floats, left: Floats) -> tuple[int, ...]:
    """Return the indices of residuals that chance would produce in one of twenty tables.

    `design` has shape (M, k), `left` (M,) are the residuals. Each is studentised by the fit of the others;
    Student's t with M - k - 1 degrees of freedom, Bonferroni-corrected for M.
    """
    freedom = left.size - design.shape[1] - 1
    spared = 1.0 - np.einsum("ij,jk,ik->i", design, cofactors(design), design)
    with np.errstate(all="ignore"):  # a measurement that alone determines a parameter gives 0 / 0
        others = (float(left @ left) - left**2 / spared) / freedom
        limit = student(freedom, (1.0 - CONFIDENCE) / left.size)
        found = left**2 > limit**2 * np.maximum(others, 0.0) * spared
    return tuple(int(place) for place in np.flatnonzero(found & (spared > ROUNDING)))
