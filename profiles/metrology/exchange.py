"""Exchange of contact points: a linear programme with few rows and many columns, solved from a few of them.

A minimum zone, circumscribed or inscribed circle rests on three or four of thousands of points. The programme is
the dual one: weights on the points, max gains w subject to columns w = rhs, w >= 0, by the primal simplex method.
Its basis is the set of contacts; in each step the point that is furthest outside replaces one of them. Where a
step brings nothing, Bland's rule (lowest index in, lowest index out) prevents cycling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats
from profiles.problem import refused

_MOST_EXCHANGES = 5000
_NO_STEP = 1e-12
_SMALLEST_PIVOT = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optimum:
    """Contacts (columns of the basis), their weights (>= 0), and the prices y of the rows: the circle itself."""

    basis: NDArray[np.intp]
    weights: Floats
    prices: Floats


def exchanged(
    columns: Floats,
    gains: Floats,
    rhs: Floats,
    basis: NDArray[np.intp],
    *,
    tolerance: float,
    excess_of: Callable[[Floats], Floats],
) -> Optimum:
    """Return the optimum of max gains w, columns w = rhs, w >= 0, from a feasible basis.

    `columns` is (m, n), `gains` (n,), `rhs` (m,), `basis` m column indices. `excess_of` prices (m,) is by how much
    gains exceed prices columns (n,), and takes nearly all of the time; at the optimum nothing exceeds `tolerance`
    (in the unit of the gains).
    Raises `ProfileError`: `trace.no_circle`, the exchange does not end, which was never observed on a sound
    profile.
    """
    basis = basis.copy()
    careful = False
    for _ in range(_MOST_EXCHANGES):
        inverse = np.linalg.inv(columns[:, basis])
        weights, prices = inverse @ rhs, gains[basis] @ inverse
        excess = excess_of(prices)
        excess[basis] = 0.0
        entering = int(np.argmax(excess > tolerance)) if careful else int(np.argmax(excess))
        if excess[entering] <= tolerance:
            return Optimum(basis=basis, weights=np.maximum(weights, 0.0), prices=prices)
        direction = inverse @ columns[:, entering]
        rows = np.flatnonzero(direction > _SMALLEST_PIVOT)
        if rows.size == 0:
            break
        ratios = np.maximum(weights[rows], 0.0) / direction[rows]
        step = float(ratios.min())
        tied = rows[ratios <= step + _NO_STEP]
        leaving = tied[np.argmin(basis[tied])] if careful else tied[np.argmax(direction[tied])]
        basis[leaving] = entering
        careful = step <= _NO_STEP
    raise refused("trace.no_circle", value=f"{_MOST_EXCHANGES}", limit="0")
