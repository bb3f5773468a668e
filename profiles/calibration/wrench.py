"""The chucking force by wrench torque, from a wrench and a load cell (Lee & Lee 2001, section 2).

Of a scroll chuck F = 2 pi eta i Tq / p: a line through the origin, F = c Tq. With a preload or a friction that
must be overcome first it is F = a + c Tq. A gauge scatters by so many newtons, friction by so many percent of the
force; so one clamping has the variance

s^2 v,    v = 1 - w + w (Tq / middle)^2,    w from 0 (the same everywhere) to 1 (in proportion to the torque)

and w is that of the greatest restricted likelihood. Weighted least squares of M clampings, W = diag(1 / v):

the line           F +- t s sqrt(x' (X' W X)^-1 x),        x = (Tq) or (1, Tq)
    a new clamping     F +- t s sqrt(v + x' (X' W X)^-1 x)
    the torque for F   the two Tq at which F leaves that band (E. C. Fieller)

Half-widths are for 95 %, by Student's t. A dozen clampings do not tell w well: each limit is the widest of those
that come out with the likeliest w and with the least and the greatest that are about as likely. A lack of fit is
found from repeated torques (what they scatter against what the line misses), or else against a parabola. An
outlier is a clamping whose residual, studentised by the others, chance would give in one of twenty such tables.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.least_squares import CONFIDENCE, ROUNDING, chance_of, fit, outliers, student
from profiles.problem import ProfileError, refusal_error

LEAST_SPARE = 3  # minimum clampings beyond the parameters: with fewer the confidence is a guess
LEAST_SPREAD = 1.5  # minimum ratio of largest to smallest torque: a line needs a range
_GROWING = np.linspace(0.0, 1.0, 21)
_AS_LIKELY = 0.7
"""Loss of log-likelihood up to which another growing fraction of the scatter is about as likely.

A choice: with it 95 % of simulated tables include the true value, for either kind of scatter.
"""


class Cofactors(NamedTuple):
    """(X' W X)^-1 of intercept and slope; 0 but for the slope where the line goes through the origin."""

    intercept: float
    both: float
    slope: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfidenceInterval:
    """A value with its 95 % limits."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WrenchFit:
    """F = intercept + slope Tq, N and N m. `intercept_n` and its half-width are 0 for a line through the origin.

    `covariance` holds the cofactors of (1, Tq), under the name that they have in kept calibrations. `sd_n` is the
    scatter of one clamping in the middle of what was measured, `freedom` its degrees of freedom, `growing` the
    fraction w of its variance that grows with the torque. `as_likely` are the lines of other fractions that the
    measurements do not rule out, each as (w, intercept, slope, sd, cofactors): every limit is the widest of all.
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
    growing: float = 0.0
    as_likely: tuple[tuple[float, float, float, float, float, float, float], ...] = ()

    @property
    def misses(self) -> bool:
        """Whether a line is not what the measurements show."""
        return self.lack_of_fit_chance is not None and self.lack_of_fit_chance < 1.0 - CONFIDENCE

    @property
    def middle_n_m(self) -> float:
        """The middle of the measured torques."""
        return 0.5 * (self.lowest_n_m + self.highest_n_m)

    @property
    def force_sd_percent(self) -> float:
        """The scatter of one clamping relative to the force in the middle of the measured range, %."""
        return 100.0 * self.sd_n / self._lines[0].force_at(self.middle_n_m)

    def line_n(self, torque_n_m: float) -> ConfidenceInterval:
        """Return the mean force of many clampings at a torque: the uncertainty of the line alone."""
        return self._band(torque_n_m, one=False)

    def force_n(self, torque_n_m: float) -> ConfidenceInterval:
        """Return the total chucking force of one clamping at a torque.

        Raises `ProfileError`: `calibration.outside`, a torque at which nothing was measured.
        """
        self._refuse_outside(torque_n_m, "torque_n_m")
        return self._band(torque_n_m, one=True)

    def torque_n_m(self, force_n: float) -> ConfidenceInterval:
        """Return the torque for a total chucking force, and the limits of the torques that may give it.

        Raises `ProfileError`: `calibration.outside`; `calibration.no_slope`, the scatter leaves no limits.
        """
        value = (force_n - self.intercept_n) / self.slope_n_per_n_m
        self._refuse_outside(value, "force_n")
        found = [line.torques_n_m(force_n, self.freedom) for line in self._lines]
        limits = [each for each in found if each is not None]
        if len(limits) < len(found):
            raise _no_slope(self.slope_n_per_n_m, self.slope_ci)
        return ConfidenceInterval(
            value=value, low=min(low for low, _ in limits), high=max(high for _, high in limits)
        )

    def _band(self, torque_n_m: float, *, one: bool) -> ConfidenceInterval:
        """Return the force with the widest limits of all lines: of `one` new clamping, or of the line itself."""
        found = [
            (line.force_at(torque_n_m), line.reach_n(torque_n_m, self.freedom, one=one)) for line in self._lines
        ]
        low, high = min(at - reach for at, reach in found), max(at + reach for at, reach in found)
        return ConfidenceInterval(value=found[0][0], low=low, high=high)

    @property
    def _lines(self) -> list[_WeightedLine]:
        best = (self.growing, self.intercept_n, self.slope_n_per_n_m, self.sd_n, *self.covariance)
        return [
            _WeightedLine(*each[:4], Cofactors(*each[4:]), self.middle_n_m) for each in (best, *self.as_likely)
        ]

    def _refuse_outside(self, torque_n_m: float, key: str) -> None:
        slack = ROUNDING * self.highest_n_m
        if not self.lowest_n_m - slack <= torque_n_m <= self.highest_n_m + slack:
            value, limit = f"{torque_n_m:g} N m", f"{self.lowest_n_m:g} … {self.highest_n_m:g} N m"
            raise refusal_error("calibration.outside", key=key, value=value, limit=limit)


@dataclass(frozen=True, slots=True)
class _WeightedLine:
    """The line for one fraction w: sd^2 (1 - w + w (Tq / middle)^2) is the variance of one clamping."""

    growing: float
    intercept_n: float
    slope: float
    sd_n: float
    cofactors: Cofactors
    middle_n_m: float
    log_likelihood: float = 0.0

    def force_at(self, torque_n_m: float) -> float:
        return self.intercept_n + self.slope * torque_n_m

    def reach_n(self, torque_n_m: float, freedom: int, *, one: bool = False) -> float:
        """Return the half-width of the line at a torque, or of `one` new clamping there."""
        known = self.cofactors
        variance_ratio = known.intercept + 2 * known.both * torque_n_m + known.slope * torque_n_m**2
        if one:
            variance_ratio += 1.0 - self.growing + self.growing * (torque_n_m / self.middle_n_m) ** 2
        return student(freedom) * self.sd_n * math.sqrt(variance_ratio)

    def slope_half(self, best: _WeightedLine, freedom: int) -> float:
        """Return the half-width of the slope, relative to the best line."""
        own = student(freedom) * self.sd_n * math.sqrt(self.cofactors.slope)
        return abs(self.slope - best.slope) + own

    def intercept_half_n(self, best: _WeightedLine, freedom: int) -> float:
        """Return the half-width of the intercept, relative to the best line."""
        own_n = student(freedom) * self.sd_n * math.sqrt(self.cofactors.intercept)
        return abs(self.intercept_n - best.intercept_n) + own_n

    def torques_n_m(self, force_n: float, freedom: int) -> tuple[float, float] | None:
        """Return the torques at which a force leaves the band of one clamping, None where it does not."""
        above_n = force_n - self.intercept_n
        reach = (student(freedom) * self.sd_n) ** 2
        square = self.slope**2 - reach * (self.cofactors.slope + self.growing / self.middle_n_m**2)
        linear = self.slope * above_n + reach * self.cofactors.both
        constant = above_n**2 - reach * (1.0 - self.growing + self.cofactors.intercept)
        if square <= 0:
            return None
        root = math.sqrt(max(linear**2 - square * constant, 0.0))
        return (linear - root) / square, (linear + root) / square


def fit_wrench(torque_n_m: ArrayLike, force_n: ArrayLike, *, affine: bool = False) -> WrenchFit:
    """Return the line through M clampings; shapes (M,), forces as totals over all jaws.

    Raises `ProfileError`: `calibration.not_positive`; `calibration.few_points`; `calibration.alike`, torques too
    close together; `calibration.no_slope`, the scatter hides that force grows with torque.
    """
    torque, force = floats(torque_n_m), floats(force_n)
    _refuse_unfit(torque, force, 2 if affine else 1)
    design = np.stack([np.ones_like(torque), torque], axis=1) if affine else torque[:, None]
    best, *others = _likely_lines(design, torque, force)
    freedom = force.size - design.shape[1]
    slope_ci = max(line.slope_half(best, freedom) for line in (best, *others))
    if best.slope <= slope_ci:
        raise _no_slope(best.slope, slope_ci)
    # An exact line leaves nothing to judge.
    exact = best.sd_n <= ROUNDING * float(force.max())
    root = 1.0 / np.sqrt(_variances(torque, best.growing))
    left = root * (force - best.intercept_n - best.slope * torque)
    return WrenchFit(
        slope_n_per_n_m=best.slope,
        slope_ci=slope_ci,
        intercept_n=best.intercept_n,
        intercept_ci=max(line.intercept_half_n(best, freedom) for line in (best, *others)),
        sd_n=best.sd_n,
        points=force.size,
        freedom=freedom,
        covariance=best.cofactors,
        lowest_n_m=float(torque.min()),
        highest_n_m=float(torque.max()),
        lack_of_fit_chance=None if exact else _lack_of_fit(torque, force, root, left, freedom),
        outliers=() if exact else outliers(root[:, None] * design, left),
        growing=best.growing,
        as_likely=tuple((e.growing, e.intercept_n, e.slope, e.sd_n, *e.cofactors) for e in others),
    )


def _likely_lines(design: Floats, torque: Floats, force: Floats) -> list[_WeightedLine]:
    """Return the likeliest line, then those at both ends of the fractions that are about as likely."""
    lines = [_line(design, torque, force, float(growing)) for growing in _GROWING]
    best = max(lines, key=lambda line: line.log_likelihood)
    if best.sd_n <= ROUNDING * float(force.max()):
        return [lines[0]]
    likely = [line for line in lines if line.log_likelihood >= best.log_likelihood - _AS_LIKELY]
    ends = dict.fromkeys((likely[0], likely[-1]))
    return [best, *(line for line in ends if line is not best)]


def _line(design: Floats, torque: Floats, force: Floats, growing: float) -> _WeightedLine:
    """Return the weighted least squares for one fraction, with its restricted likelihood."""
    variances = _variances(torque, growing)
    found = fit(design, force, 1.0 / np.sqrt(variances))
    *intercept, slope = found.coefficients.tolist()
    known = found.cofactors.ravel().tolist()
    own = (known[0], known[1], known[-1]) if intercept else (0.0, 0.0, known[-1])
    scatter = found.freedom * math.log(found.variance) if found.variance > 0.0 else -math.inf
    information = float(np.log(variances).sum() - np.linalg.slogdet(found.cofactors)[1])
    likelihood = -0.5 * (scatter + information)
    first = intercept[0] if intercept else 0.0
    return _WeightedLine(growing, first, slope, found.residual_sd, Cofactors(*own), _middle(torque), likelihood)


def _variances(torque: Floats, growing: float) -> Floats:
    """Return the variances of single clampings relative to that in the middle; shape (M,)."""
    return floats(1.0 - growing + growing * (torque / _middle(torque)) ** 2)


def _middle(torque: Floats) -> float:
    return 0.5 * (float(torque.min()) + float(torque.max()))


def _refuse_unfit(torque: Floats, force: Floats, parameters: int) -> None:
    if torque.ndim != 1 or torque.shape != force.shape or torque.size < parameters + LEAST_SPARE:
        limit = f">= {parameters + LEAST_SPARE}"
        raise refusal_error("calibration.few_points", value=str(torque.size), limit=limit)
    for key, column in (("torque_n_m", torque), ("force_n", force)):
        worst = column[~((column > 0) & np.isfinite(column))]
        if worst.size:
            raise refusal_error("calibration.not_positive", key=key, value=f"{worst[0]:g}", limit="> 0")
    if torque.max() < LEAST_SPREAD * torque.min():
        value, limit = f"{torque.min():g} … {torque.max():g} N m", f"1 : {LEAST_SPREAD:g}"
        raise refusal_error("calibration.alike", key="torque_n_m", value=value, limit=limit)


def _no_slope(slope: float, ci: float) -> ProfileError:
    value = f"{slope:.4g} ± {ci:.4g} N/(N m)"
    return refusal_error("calibration.no_slope", key="slope_n_per_n_m", value=value, limit="> 0 N/(N m)")


def _lack_of_fit(torque: Floats, force: Floats, root: Floats, left: Floats, freedom: int) -> float | None:
    """Return the chance of such a lack of fit: against repeated torques, else against a parabola.

    `root` are the roots of the weights, `left` what the line leaves of each force, by its root.
    """
    missed = float(left @ left)
    levels, member = np.unique(torque, return_inverse=True)
    pure_freedom = force.size - levels.size
    if pure_freedom == 0:
        bent = torque / torque.max()
        parabola = fit(np.stack([np.ones_like(bent), bent, bent**2], axis=1), force, root)
        pure, pure_freedom = float(np.sum((root * parabola.residuals) ** 2)), parabola.freedom
    else:
        means = np.bincount(member, weights=force) / np.bincount(member)
        pure = float(np.sum((root * (force - means[member])) ** 2))
    added = freedom - pure_freedom
    if added < 1 or pure_freedom < 1:
        return None
    if pure <= ROUNDING**2 * missed:
        return 0.0
    # A line through the means misses no more than they do, and by rounding slightly less.
    return chance_of(max(missed - pure, 0.0) / added / (pure / pure_freedom), added, pure_freedom)
