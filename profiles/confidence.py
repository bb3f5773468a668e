"""Student's t and Fisher's F at the one confidence level used everywhere."""

from __future__ import annotations

import math

CONFIDENCE = 0.95


def student(freedom: float, chance: float = 1.0 - CONFIDENCE) -> float:
    """Return the half-width in standard errors: both tails of t together hold `chance`."""
    from scipy.special import ndtri, stdtrit

    below = 1.0 - 0.5 * chance
    return float(ndtri(below) if math.isinf(freedom) else stdtrit(freedom, below))


def chance_of(ratio: float, added: int, freedom: float) -> float:
    """Return the probability of an F of `ratio` or more by chance, `added` over `freedom` degrees of freedom."""
    from scipy.special import fdtrc

    return float(fdtrc(added, freedom, ratio))
