"""The lobe of a part from its trace: amplitude, phase and their uncertainty.

Model of M deviations r_i (um, positive outwards) at spindle angles theta_i, with the orders n of eccentricity,
ovality and the jaws, n in {1, 2, N, 2N, 3N} and any that are declared:

r_i = c + sum_n (p_n cos n theta_i + q_n sin n theta_i) + noise,    p cos + q sin = A cos(n (theta - phase))

Weighted least squares with W = diag(1 / sigma_i^2), after C. F. Gauss:

beta = (X' W X)^-1 X' W r,    cov = s^2 (X' W X)^-1,    s^2 = sum W e^2 / (M - k)

A = hypot(p, q),           sd(A) = sqrt(J C J'),              J = (p, q) / A
    phase = atan2(q, p) / n,   sd(phase) = sqrt(K C K') / n,      K = (-q, p) / A^2

so that white noise at equal angles gives sd(A) = sigma sqrt(2 / M). The residual of a real part is not white:
its form error falls with the order, so that the lobe has more of it than the average order. For each harmonic
s^2 is therefore that of its order, see `profiles.metrology.noise_spectrum`, unless the residual is about as
likely white. Real traces repeat from turn to turn, so that with several turns each is fitted for itself, too,
and the larger of the two standard errors is reported: by the residuals (M - k degrees of freedom, fewer where
s^2 is that of an order), by the T turns (T - 1). The 95 % half-width by the residuals is wider than that by the
standard error: it is of all spectra that the residuals allow (`NoiseSpectrum.half_width_at`).

A harmonic is significant where A exceeds its sd by sqrt(2 F) with F the 95 % point of Fisher's F of 2 and as many
degrees of freedom (2.45 for many), and 1e-6 um, below which there is only rounding. Small amplitudes come out too
large: E[A^2] = A0^2 + 2 sd^2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.least_squares import CONFIDENCE, Fit, fit, harmonic_columns, harmonic_slice, huber_distances, student
from profiles.metrology.noise_spectrum import NoiseSpectrum, noise_spectrum
from profiles.problem import refusal_error

HIGHEST_ORDER = 500  # undulations per revolution above which no harmonic is declared
_WORST_CONDITION = 100.0  # above this ratio of singular values these angles cannot separate the harmonics
_HIGHEST_LEFT = 50
_GAP_TOLERANCE_DEG = 1e-6
_SETTLED = 1e-6  # change of Huber's weights from one iteration to the next at which they have converged
_STRAY = 4.0
"""Residual in robust standard deviations from which a point is a chip or a scratch: one in 16 000 by chance."""
_ROUNDING = 1e-12
_LEAST_UM = 1e-6  # an amplitude up to this is none, however regular a trace without noise is


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedHarmonic:
    """amplitude cos(n (angle - phase)): one harmonic; phase in [0, 360/n) deg of the angle of the trace.

    `cos_um` and `sin_um` are p and q. `sd_um` and `sd_deg` are standard errors of amplitude and phase, `ci_um`
    and `ci_deg` half-widths for 95 %. `sd_deg` is at most 360 / (n sqrt 12), the sd of an
    entirely unknown phase, and `ci_deg` at most 180 / n.
    """

    n: int
    cos_um: float
    sin_um: float
    amplitude_um: float
    phase_deg: float
    sd_um: float
    sd_deg: float
    ci_um: float
    ci_deg: float
    significant: bool

    @property
    def bias_um(self) -> float:
        """The noise bias of the amplitude: A - sqrt(A^2 - 2 sd^2), at most all of it."""
        return self.amplitude_um - math.sqrt(max(self.amplitude_um**2 - 2 * self.sd_um**2, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class LobeFit:
    """The harmonics of a trace, by order. `noise_um` is the standard deviation of the residuals.

    `points` were fitted, over `turns` turns (1: the confidence is from the residuals alone); `left_out` were
    taken for chips and scratches. `left_n` is the most prominent order that was not fitted, and `left_um` its
    amplitude; `floor_um` is the amplitude that noise shows at that order once in twenty traces: well above it
    the harmonic should have been declared.
    """

    jaws: int
    harmonics: tuple[FittedHarmonic, ...]
    mean_um: float
    noise_um: float
    points: int
    left_out: int
    turns: int
    left_n: int
    left_um: float
    floor_um: float

    @property
    def lobe(self) -> FittedHarmonic:
        """The harmonic with as many undulations as there are jaws."""
        return self.harmonic(self.jaws)

    @property
    def error_um_pp(self) -> float:
        """Peak to peak of the lobe alone: twice its amplitude, the 55 um of Fig 14 of Lee & Lee (2001)."""
        return 2 * self.lobe.amplitude_um

    def harmonic(self, n: int) -> FittedHarmonic:
        """Return the harmonic of order n, which must have been fitted."""
        return next(harmonic for harmonic in self.harmonics if harmonic.n == n)


def fit_lobe(
    angle_deg: ArrayLike,
    deviation_um: ArrayLike,
    jaws: int,
    *,
    sigma_um: ArrayLike | None = None,
    extra: Iterable[int] = (),
    robust: bool = False,
) -> LobeFit:
    """Fit the lobe in a trace of M points with its confidence.

    `angle_deg` (M,) is in any order, unequal if need be; angles beyond 360 are further turns. `deviation_um` (M,)
    is positive outwards, from any nominal radius. `jaws` is N, the lobes a turn. `sigma_um` is the standard
    deviation of each point, shape (M,) or one for all; only their ratios count: the size of the noise follows from
    the residuals. `extra` are orders in the trace besides {1, 2, N, 2N, 3N}. `robust`: find chips and scratches by
    a fit with Huber's weights, and leave them out of the last one.

    Raises `ProfileError`: `trace.columns`, `trace.not_finite`, `trace.few_points`, `trace.narrow_angles`;
    `lobe_fit.sigma`, one that is not above 0; `lobe_fit.order`, an order that cannot be declared;
    `lobe_fit.dependent`, angles that cannot separate the harmonics.
    """
    orders = _orders(jaws, extra)
    angle, deviation, root_weight = _check_samples(angle_deg, deviation_um, sigma_um)
    _refuse_thin(angle, jaws, orders)
    design = harmonic_columns(np.radians(angle), orders)
    kept = np.ones(angle.size, dtype=bool)
    if robust:
        rounding_um = _ROUNDING * float(np.abs(deviation).max())
        kept = huber_distances(design, deviation, root_weight, rounding_um, _SETTLED) <= _STRAY
        _refuse_thin(angle[kept], jaws, orders)
    angle, deviation, design, root_weight = angle[kept], deviation[kept], design[kept], root_weight[kept]
    found = fit(design, deviation, root_weight)
    if found.condition > _WORST_CONDITION:
        value = ", ".join(str(n) for n in orders)
        raise refusal_error("lobe_fit.dependent", value=value, limit=f"{_WORST_CONDITION:g}")
    beta = found.coefficients
    noise = noise_spectrum(angle, root_weight * found.residuals, orders, beta.size)
    of_turns = _turns(angle, deviation, design, root_weight)
    covariances = _covariances(found, noise, of_turns, orders)
    left_n, left_um, floor_um = _most_left(noise, orders, root_weight)
    return LobeFit(
        jaws=jaws,
        harmonics=tuple(
            _harmonic(n, place, beta, covariances[n], noise.half_width_at(n) ** 2 * found.cofactors)
            for place, n in enumerate(orders)
        ),
        mean_um=float(beta[0]),
        noise_um=math.sqrt(noise.level),
        points=deviation.size,
        left_out=kept.size - deviation.size,
        turns=max(len(of_turns), 1),
        left_n=left_n,
        left_um=left_um,
        floor_um=floor_um,
    )


def _orders(jaws: int, extra: Iterable[int]) -> tuple[int, ...]:
    if jaws < 2:
        raise refusal_error("lobe_fit.order", key="jaws", value=str(jaws), limit=">= 2")
    declared = tuple(extra)
    for n in declared:
        if not 1 <= n <= HIGHEST_ORDER:
            limit = f"1 … {HIGHEST_ORDER}"
            raise refusal_error("lobe_fit.order", key="extra", value=str(n), limit=limit)
    return tuple(sorted({1, 2, jaws, 2 * jaws, 3 * jaws, *declared}))


def _check_samples(
    angle_deg: ArrayLike, deviation_um: ArrayLike, sigma_um: ArrayLike | None
) -> tuple[Floats, Floats, Floats]:
    """Return angles, deviations and the square roots of the weights, whose squares have the mean 1."""
    angle = floats(angle_deg)
    deviation = floats(deviation_um)
    sigma = floats(1.0 if sigma_um is None else sigma_um)
    if angle.ndim != 1 or angle.shape != deviation.shape or sigma.shape not in ((), angle.shape):
        value = f"{angle.shape} {deviation.shape} {sigma.shape}"
        raise refusal_error("trace.columns", value=value, limit="(M,) (M,)")
    for key, column in (("angle_deg", angle), ("deviation_um", deviation), ("sigma_um", sigma)):
        if not np.isfinite(column).all():
            value = str(column[~np.isfinite(column)].flat[0])
            raise refusal_error("trace.not_finite", key=key, value=value)
    if (sigma <= 0).any():
        raise refusal_error("lobe_fit.sigma", value=f"{sigma.min():g} um", limit="> 0 um")
    weight = np.broadcast_to(1 / sigma**2, angle.shape)
    return angle, deviation, np.sqrt(weight / weight.mean()) if angle.size else weight


def _refuse_thin(angle: Floats, jaws: int, orders: tuple[int, ...]) -> None:
    """Refuse too few directions for the highest order, and a gap that can hide a whole flank of a lobe."""
    places = np.unique(np.round(angle % 360.0, 6) % 360.0)
    needed = 2 * max(orders) + 1
    if places.size < needed:
        raise refusal_error("trace.few_points", value=str(places.size), limit=f">= {needed}")
    gap_deg = float(np.diff(places, append=places[0] + 360.0).max())
    most_deg = 180.0 / jaws
    if gap_deg > most_deg + _GAP_TOLERANCE_DEG:
        raise refusal_error(
            "trace.narrow_angles", key="angle_deg", value=f"{gap_deg:g} deg", limit=f"{most_deg:g} deg"
        )


def _turns(angle: Floats, deviation: Floats, design: Floats, root_weight: Floats) -> list[Floats]:
    """Return the coefficients of each turn that can be fitted on its own; an incomplete last turn cannot."""
    turn = np.floor((angle - angle.min()) / 360.0 + _GAP_TOLERANCE_DEG / 360.0)
    found = []
    for number in np.unique(turn):
        own = turn == number
        one = fit(design[own], deviation[own], root_weight[own])
        if one.freedom > 0 and one.condition <= _WORST_CONDITION:
            found.append(one.coefficients)
    return found


def _covariances(
    found: Fit, noise: NoiseSpectrum, of_turns: list[Floats], orders: tuple[int, ...]
) -> dict[int, list[tuple[Floats, float]]]:
    """Return, by order, the covariances of all coefficients with their degrees of freedom."""
    by_turns = [(np.cov(of_turns, rowvar=False) / len(of_turns), len(of_turns) - 1.0)] if len(of_turns) > 1 else []
    at = {n: noise.variance_at(n) for n in orders}
    return {n: [(variance * found.cofactors, freedom), *by_turns] for n, (variance, freedom) in at.items()}


def _harmonic(
    n: int, place: int, beta: Floats, covariances: list[tuple[Floats, float]], squares: Floats
) -> FittedHarmonic:
    """Return one harmonic; its standard errors are the largest by any of the covariances (with their freedom).

    `squares` are those of the 95 % half-widths by the residuals, as a covariance; the turns may show more.
    """
    both = harmonic_slice(place)
    p, q = (float(part) for part in beta[both])
    amplitude = math.hypot(p, q)
    along = np.array([p, q]) / amplitude if amplitude else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    radial, tangential = (
        max((_root(way @ c[both, both] @ way), freedom) for c, freedom in covariances) for way in (along, across)
    )
    turns = covariances[1:]
    radial_ci, tangential_ci = (
        max(
            _root(way @ squares[both, both] @ way),
            *(student(f) * _root(way @ c[both, both] @ way) for c, f in turns),
            0.0,
        )
        for way in (along, across)
    )
    unknown_deg = 360.0 / n / math.sqrt(12.0)
    to_deg = math.degrees(1.0 / (n * amplitude)) if amplitude else math.inf
    return FittedHarmonic(
        n=n,
        cos_um=p,
        sin_um=q,
        amplitude_um=amplitude,
        phase_deg=math.degrees(math.atan2(q, p)) / n % (360.0 / n),
        sd_um=radial[0],
        sd_deg=min(tangential[0] * to_deg, unknown_deg) if amplitude else unknown_deg,
        ci_um=radial_ci,
        ci_deg=min(tangential_ci * to_deg, 180.0 / n) if amplitude else 180.0 / n,
        significant=amplitude > max(_significant_at(radial[1]) * radial[0], _LEAST_UM),
    )


def _root(square: Any) -> float:
    return math.sqrt(max(float(square), 0.0))


def _significant_at(freedom: float) -> float:
    """Return sqrt(2 F), F the 95 % point of Fisher's F of 2 and `freedom` degrees of freedom; in closed form."""
    chance = 1.0 - CONFIDENCE
    if math.isinf(freedom):
        return math.sqrt(-2.0 * math.log(chance))
    return math.sqrt(freedom * math.expm1(-2.0 / freedom * math.log(chance)))


def _most_left(noise: NoiseSpectrum, orders: tuple[int, ...], root_weight: Floats) -> tuple[int, float, float]:
    """Return order, amplitude and floor of the most prominent residual harmonic; 0 where there is none."""
    found = [(0, 0.0, _floor_um(noise.level, root_weight.size))]
    for n, power in enumerate(noise.powers[:_HIGHEST_LEFT], start=1):
        if n not in orders:
            size_um = 2.0 * math.sqrt(float(power) * root_weight.size) / float(root_weight.sum())
            found.append((n, size_um, _floor_um(noise.variance_at(n)[0], root_weight.size)))
    return max(found, key=lambda each: each[1] / each[2] if each[2] else 0.0)


def _floor_um(variance: float, points: int) -> float:
    return _significant_at(math.inf) * math.sqrt(2.0 * variance / points)
