"""The chucking force by the torque of the wrench, from a wrench and a load cell (Lee & Lee 2001, section 2).

Of a scroll chuck F = 2 pi eta i Tq / p: a line through the origin, F = c Tq. With a preload or a friction that
must be overcome first it is F = a + c Tq. Least squares of M clampings, with s^2 the variance of what is left:

    the line           F +- t s sqrt(x' (X' X)^-1 x),        x = (Tq) or (1, Tq)
    a new clamping     F +- t s sqrt(1 + x' (X' X)^-1 x)
    the torque for F   the two Tq at which F leaves that band (E. C. Fieller)

Half-widths are for 95 %, by Student's t. The scatter is taken to be the same at every torque. A lack of fit is
found from repeated torques (what they scatter against what the line misses), or else against a parabola. An
outlier is a clamping whose residual, studentised by the others, chance would give in one of twenty such tables.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.calibration.outliers import ROUNDING, outliers
from profiles.confidence import CONFIDENCE, chance_of, student
from profiles.problem import Problem, ProfileError

LEAST_SPARE = 3
"""Clampings beyond the parameters, at least: with fewer the confidence is a guess."""

LEAST_SPREAD = 1.5
"""Largest torque over smallest, at least: a line needs a length."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A value with its 95 % limits."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WrenchFit:
    """F = intercept + slope Tq, N and N m. `intercept_n` and its half-width are 0 for a line through the origin.

    `covariance` is (X' X)^-1 of (1, Tq), `sd_n` the scatter of one clamping, `freedom` its degrees of freedom.
    `lack_of_fit_chance` is how often chance alone misses a true line by so much; None where that cannot be told.
    `outliers` are places in the measurements. It holds from `lowest_n_m` to `highest_n_m`.
    """

    slope_n_per_n_m: float
    slope_ci: float
    intercept_n: float
    intercept_ci: float
    sd_n: float
    points: int
    freedom: int
    covariance: tuple[float, float, float]
    lowest_n_m: float
    highest_n_m: float
    lack_of_fit_chance: float | None
    outliers: tuple[int, ...]

    @property
    def misses(self) -> bool:
        """Whether a line is not what the measurements show."""
        return self.lack_of_fit_chance is not None and self.lack_of_fit_chance < 1.0 - CONFIDENCE

    @property
    def middle_n_m(self) -> float:
        """The middle of the torques that were measured."""
        return 0.5 * (self.lowest_n_m + self.highest_n_m)

    @property
    def force_sd_percent(self) -> float:
        """The scatter of one clamping as a share of the force in the middle of what was measured, %."""
        return 100.0 * self.sd_n / self.line_n(self.middle_n_m).value

    def line_n(self, torque_n_m: float) -> Band:
        """Return the mean force of many clampings at a torque: what is sure of the line itself."""
        reach = student(self.freedom) * self.sd_n * math.sqrt(self._leverage(torque_n_m))
        value = self.intercept_n + self.slope_n_per_n_m * torque_n_m
        return Band(value=value, low=value - reach, high=value + reach)

    def force_n(self, torque_n_m: float) -> Band:
        """Return the total chucking force of one clamping at a torque.

        Raises:
            ProfileError: `calibration.outside`, a torque at which nothing was measured.
        """
        self._refuse_outside(torque_n_m, "torque_n_m")
        reach = student(self.freedom) * self.sd_n * math.sqrt(1 + self._leverage(torque_n_m))
        value = self.line_n(torque_n_m).value
        return Band(value=value, low=value - reach, high=value + reach)

    def torque_n_m(self, force_n: float) -> Band:
        """Return the torque for a total chucking force, and between which torques that force may have come from.

        Raises:
            ProfileError: `calibration.outside`; `calibration.no_slope`, the scatter leaves no limits.
        """
        above_n = force_n - self.intercept_n
        value = above_n / self.slope_n_per_n_m
        self._refuse_outside(value, "force_n")
        u00, u01, u11 = self.covariance
        reach = (student(self.freedom) * self.sd_n) ** 2
        square = self.slope_n_per_n_m**2 - reach * u11
        linear = self.slope_n_per_n_m * above_n + reach * u01
        constant = above_n**2 - reach * (1 + u00)
        if square <= 0:
            raise ProfileError(_no_slope(self.slope_n_per_n_m, self.slope_ci))
        root = math.sqrt(max(linear**2 - square * constant, 0.0))
        return Band(value=value, low=(linear - root) / square, high=(linear + root) / square)

    def _leverage(self, torque_n_m: float) -> float:
        u00, u01, u11 = self.covariance
        return u00 + 2 * u01 * torque_n_m + u11 * torque_n_m**2

    def _refuse_outside(self, torque_n_m: float, key: str) -> None:
        slack = ROUNDING * self.highest_n_m
        if not self.lowest_n_m - slack <= torque_n_m <= self.highest_n_m + slack:
            value, limit = f"{torque_n_m:g} N m", f"{self.lowest_n_m:g} … {self.highest_n_m:g} N m"
            raise ProfileError(Problem(code="calibration.outside", key=key, value=value, limit=limit))


def fit_wrench(torque_n_m: ArrayLike, force_n: ArrayLike, *, affine: bool = False) -> WrenchFit:
    """Return the line through M clampings; shapes (M,), forces as totals over all jaws.

    Raises:
        ProfileError: `calibration.not_positive`; `calibration.few_points`; `calibration.alike`, torques too near
            to each other; `calibration.no_slope`, the scatter hides that force grows with torque.
    """
    torque, force = np.asarray(torque_n_m, dtype=np.float64), np.asarray(force_n, dtype=np.float64)
    _refuse_unfit(torque, force, 2 if affine else 1)
    design = np.stack([np.ones_like(torque), torque], axis=1) if affine else torque[:, None]
    spread = np.linalg.inv(design.T @ design)
    beta = spread @ design.T @ force
    freedom = force.size - beta.size
    left = force - design @ beta
    sd = math.sqrt(float(left @ left) / freedom)
    exact = sd <= ROUNDING * float(force.max())  # on the line to the last digit: there is nothing to judge
    half = student(freedom) * sd * np.sqrt(np.diag(spread))
    slope, slope_ci = float(beta[-1]), float(half[-1])
    if slope <= slope_ci:
        raise ProfileError(_no_slope(slope, slope_ci))
    covariance = (spread[0, 0], spread[0, 1], spread[1, 1]) if affine else (0.0, 0.0, spread[0, 0])
    return WrenchFit(
        slope_n_per_n_m=slope,
        slope_ci=slope_ci,
        intercept_n=float(beta[0]) if affine else 0.0,
        intercept_ci=float(half[0]) if affine else 0.0,
        sd_n=sd,
        points=force.size,
        freedom=freedom,
        covariance=(float(covariance[0]), float(covariance[1]), float(covariance[2])),
        lowest_n_m=float(torque.min()),
        highest_n_m=float(torque.max()),
        lack_of_fit_chance=None if exact else _lack_of_fit(torque, force, left, freedom),
        outliers=() if exact else outliers(design, left),
    )


def _refuse_unfit(torque: Floats, force: Floats, parameters: int) -> None:
    if torque.ndim != 1 or torque.shape != force.shape or torque.size < parameters + LEAST_SPARE:
        limit = f">= {parameters + LEAST_SPARE}"
        raise ProfileError(Problem(code="calibration.few_points", value=str(torque.size), limit=limit))
    for key, column in (("torque_n_m", torque), ("force_n", force)):
        worst = column[~((column > 0) & np.isfinite(column))]
        if worst.size:
            raise ProfileError(
                Problem(code="calibration.not_positive", key=key, value=f"{worst[0]:g}", limit="> 0")
            )
    if torque.max() < LEAST_SPREAD * torque.min():
        value, limit = f"{torque.min():g} … {torque.max():g} N m", f"1 : {LEAST_SPREAD:g}"
        raise ProfileError(Problem(code="calibration.alike", key="torque_n_m", value=value, limit=limit))


def _no_slope(slope: float, ci: float) -> Problem:
    value = f"{slope:.4g} ± {ci:.4g} N/(N m)"
    return Problem(code="calibration.no_slope", key="slope_n_per_n_m", value=value, limit="> 0 N/(N m)")


def _lack_of_fit(torque: Floats, force: Floats, left: Floats, freedom: int) -> float | None:
    """Return how often chance gives such a lack of fit: against repeated torques, else against a parabola."""
    missed = float(left @ left)
    levels, member = np.unique(torque, return_inverse=True)
    pure_freedom = force.size - levels.size
    if pure_freedom == 0:
        parabola = np.stack([np.ones_like(torque), torque, torque**2], axis=1) / [
            1.0,
            torque.max(),
            torque.max() ** 2,
        ]
        beta = np.linalg.lstsq(parabola, force, rcond=None)[0]
        pure, pure_freedom = float(np.sum((force - parabola @ beta) ** 2)), force.size - 3
    else:
        means = np.bincount(member, weights=force) / np.bincount(member)
        pure = float(np.sum((force - means[member]) ** 2))
    added = freedom - pure_freedom
    if added < 1 or pure_freedom < 1:
        return None
    if pure <= ROUNDING**2 * missed:
        return 0.0
    return chance_of((missed - pure) / added / (pure / pure_freedom), added, pure_freedom)
