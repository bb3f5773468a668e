"""Weighted least squares of harmonics and trends, with one convention for the covariance of coefficients.

Model of M samples y_i with standard deviations in known ratios, W = diag(1 / sigma_i^2):

y = X b + e,    b = (X' W X)^-1 X' W y,    s^2 = e' W e / (M - k)

After F. R. Helmert, `cofactors` are (X' W X)^-1 and the `covariance` is s^2 times these: the project uses the
word covariance for nothing else. A harmonic of order n is p cos(n angle) + q sin(n angle) = Re{c exp(j n
angle)} with the complex coefficient c = p - j q; its phase, the angle of its maximum, is atan2(q, p) / n.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from profiles.arrays import Floats, floats

CONFIDENCE = 0.95  # the one confidence level used everywhere
ROUNDING = 1e-9  # fraction of the largest measurement below which residuals are rounding and are not judged
HUBER = 1.345  # residuals in standard deviations from which Huber's weights fall: 95 % efficient for white noise
SIGMA_OF_MEDIAN = 1.4826  # standard deviation over the median of the absolute residuals, for white noise
_HUBER_ROUNDS = 50


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """Coefficients b, shape (k,), with their cofactors (k, k) and the residuals y - X b, shape (M,).

    `variance` is s^2 with `freedom` = M - k degrees of freedom, infinite where that is 0. `condition` is the ratio
    of the largest singular value of W^(1/2) X to the smallest. Columns that depend on others get the smallest
    coefficients that fit.
    """

    coefficients: Floats
    cofactors: Floats
    residuals: Floats
    variance: float
    freedom: int
    condition: float

    @property
    def covariance(self) -> Floats:
        """The covariance of the coefficients, shape (k, k)."""
        return self.variance * self.cofactors

    @property
    def residual_sd(self) -> float:
        """The standard deviation s of a sample of weight 1."""
        return math.sqrt(self.variance)

    def sd_along(self, direction: Floats) -> float:
        """Return the standard deviation of the sum of the coefficients times `direction`, shape (k,)."""
        return math.sqrt(self.variance * max(float(direction @ self.cofactors @ direction), 0.0))


def harmonic_columns(angle_rad: Floats, orders: Sequence[int], *trends: Floats) -> Floats:
    """Return the columns 1, each of `trends` (M,), then cosine and sine of each order; shape (M, k)."""
    columns = [np.ones_like(angle_rad), *trends]
    for order in orders:
        columns += [np.cos(order * angle_rad), np.sin(order * angle_rad)]
    return np.stack(columns, axis=1)


def harmonic_slice(place: int, trends: int = 0) -> slice:
    """Return the slice of cosine and sine of the order at `place` in the coefficients of `harmonic_columns`."""
    first = 1 + trends + 2 * place
    return slice(first, first + 2)


def phasors(coefficients: Floats, orders: Sequence[int], trends: int = 0) -> dict[int, complex]:
    """Return the complex coefficients of a fit of `harmonic_columns`, by order."""
    pairs = coefficients[1 + trends :].reshape(-1, 2)
    return {order: complex(p, -q) for order, (p, q) in zip(orders, pairs, strict=True)}


def fit(columns: Floats, values: Floats, root_weight: Floats | None = None) -> Fit:
    """Fit M values by k columns, shapes (M,) and (M, k); `root_weight` (M,) is 1 / sigma, 1 without it."""
    root = np.ones_like(values) if root_weight is None else root_weight
    weighed, target = columns * root[:, None], values * root
    known, condition = _solve_normal_equations(weighed)
    coefficients = known @ (weighed.T @ target)
    coefficients += known @ (weighed.T @ (target - weighed @ coefficients))  # refinement for the last digits
    residuals = values - columns @ coefficients
    freedom = len(values) - columns.shape[1]
    squares = float(np.sum((root * residuals) ** 2))
    return Fit(
        coefficients=coefficients,
        cofactors=known,
        residuals=residuals,
        variance=squares / freedom if freedom > 0 else math.inf,
        freedom=freedom,
        condition=condition,
    )


def cofactors(columns: Floats) -> Floats:
    """Return (X' X)^-1 of columns (M, k) that are already weighted; shape (k, k)."""
    return _solve_normal_equations(columns)[0]


def huber_distances(columns: Floats, values: Floats, root_weight: Floats, least: float, settled: float) -> Floats:
    """Return the distance of each value from a fit with Huber's weights, in robust standard deviations.

    Residuals up to `least` are rounding; weights that change by up to `settled` have converged.
    """
    huber = np.ones_like(values)
    distance = np.zeros_like(values)
    for _ in range(_HUBER_ROUNDS):
        size = np.abs(fit(columns, values, root_weight * np.sqrt(huber)).residuals) * root_weight
        sigma = max(SIGMA_OF_MEDIAN * float(np.median(size)), least)
        if sigma == 0.0:
            break
        distance = size / sigma
        before, huber = huber, HUBER / np.maximum(distance, HUBER)
        if np.abs(huber - before).max() <= settled:
            break
    return distance


def _solve_normal_equations(columns: Floats) -> tuple[Floats, float]:
    """Return cofactors and condition, by the normal equations: ten times as fast as by singular values.

    A direction that is only rounding, which has an infinite condition, is left out.
    """
    squares, directions = np.linalg.eigh(columns.T @ columns)
    least = np.finfo(np.float64).eps * squares.size * squares[-1]
    inverse = np.divide(1.0, squares, out=np.zeros_like(squares), where=squares > least)
    condition = math.sqrt(squares[-1] * inverse[0]) if inverse[0] else math.inf
    return floats((directions * inverse) @ directions.T), condition


def student(freedom: float, chance: float = 1.0 - CONFIDENCE) -> float:
    """Return the half-width in standard errors: both tails of Student's t together hold `chance`."""
    from scipy.special import ndtri, stdtrit

    below = 1.0 - 0.5 * chance
    return float(ndtri(below) if math.isinf(freedom) else stdtrit(freedom, below))


def chance_of(ratio: float, added: int, freedom: float) -> float:
    """Return the probability of Fisher's F of `ratio` or more, with `added` over `freedom` degrees of freedom."""
    from scipy.special import fdtrc

    return float(fdtrc(added, freedom, ratio))


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
