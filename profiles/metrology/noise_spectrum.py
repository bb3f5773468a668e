"""The effect of correlated noise on a fitted harmonic.

White noise of the variance s^2 affects every order equally. Form error, chatter and drift do not: their
contribution falls with the order, so that the lobe has more of it than the rest of the trace. The spectrum of
the residuals is

S(n) = s^2 (1 + b / (1 + (n / n0)^2)^p),    p in {1, 2, 3}

white noise and noise with a correlation angle of about 1 / n0 rad: p = 1 is a first-order Gauss-Markov process
(AR(1) when sampled), and a higher p a smoother one. s, b, n0 and p are those of the greatest likelihood of the
power at the orders that were not fitted (P. Whittle 1953: each is exponential, of the mean S). A hump is taken
where white noise would show one as likely in one trace of twenty at most. An order far above its neighbours is
a harmonic of the part and is not counted as noise. A drift that does not close within the turn, close to a
random walk, is not covered: its 95 % intervals hold about 90 %.

The likeliest spectrum is still too sure of itself at the lowest orders, which lie outside of those that show it: a
hump is flat there, a form error may rise on. A half-width is therefore of power laws and humps and white noise,

S(n) = s^2 (1 + b' (n0^2 + n^2)^-q),    q from 0.25 to 3, n0 0 (a power law) or 8 to 64

each as likely as the single orders make it (flat in q and in ln b, n0 = 0 the likelier one before): 95 % of the
mixture of their normal distributions. Where the noise may be white, it is that of white noise. What lies below the
orders that show it nobody knows: of textures that fall as n^-0.5 to n^-2 92 to 95 % hold the truth, of closed
random walks 92 %, of AR(1) noise, which is flat there, 96 to 99 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats, floats
from profiles.least_squares import CONFIDENCE, student

HIGHEST_ORDER = 120  # orders up to here are evaluated one by one; those above count as a whole
_BEYOND = 20  # minimum orders evaluated above the highest one that was fitted
_LEAST_ORDERS = 8  # with fewer unfitted orders no spectrum can be distinguished from white
_COLOURED = 4.0  # gain of log-likelihood above which noise is not white: half of chi-square with three, 95 %
# Loss of log-likelihood for another steepness that is about as likely; the best alone would be overconfident.
_AS_LIKELY = 1.0
_LINE = 50.0  # multiple of the median of its neighbours: by chance one order in a hundred thousand
_NEIGHBOURS = 4  # neighbours of an order, on each side
_CORNERS, _HUMPS = 32, 32
_STEEPNESS = (1.0, 2.0, 3.0)
_MOST_HUMP = 1e6
_FALLS, _SIZES = np.arange(0.25, 3.01, 0.25), np.geomspace(0.1, _MOST_HUMP, 24)  # q and b of the power laws
_CORNERS_OF_LAWS = np.array([0.0, 8.0, 16.0, 32.0, 64.0])  # n0; 0: a power law
_FLAT_BELOW = math.exp(-2.0)  # odds of a law with a corner to a power law, before the orders are seen: a choice
_SECOND = 2.0  # order at which b is the size of a power law
_NEVER = 1e-6  # likelihood, of the largest, of what does not count
_FAR, _CLOSE = 6.0, 1e-9  # in standard deviations: beyond, and how exactly a half-width is found
_STEEPEST = 4  # power of the order by which the power of a form error falls at most where a line is looked for
_PRIOR = 0.1  # prior on the logarithms of hump and corner: within a factor of 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Hump:
    """S / s^2 - 1 as b, n0 and p, with its s^2; `covariance` is that of (ln s^2, ln b, ln n0), row by row."""

    level: float
    size: float
    corner: float
    steepness: float
    covariance: Floats

    def variance_at(self, n: int) -> tuple[float, float]:
        """Return the variance at an order and its degrees of freedom."""
        shape, slopes = _shape(np.array([float(n)]), self.size, self.corner, self.steepness)
        doubt = float(slopes[:, 0] @ self.covariance @ slopes[:, 0])
        # The logarithm of a variance of f degrees of freedom has the variance 2 / f.
        return self.level * float(shape[0]), max(2.0 / doubt, 1.0)


@dataclass(frozen=True, kw_only=True)
class NoiseSpectrum:
    """The effective variance at each order, with its degrees of freedom.

    `level` is that of white noise, of `freedom`; `humps` are those that are about as likely, none where the noise
    may be white. `powers` are those of the residuals, by order from 1: |sum e exp(-j n angle)|^2 / M. `single` are
    the orders that show noise alone.
    """

    level: float
    freedom: float
    powers: Floats
    humps: tuple[Hump, ...] = ()
    single: NDArray[np.int_] = field(default_factory=lambda: np.zeros(0, dtype=np.int_))

    @cached_property
    def _laws(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """The laws, one after the other: how likely, s^2, b, n0 and -q."""
        corners, falls, sizes = np.meshgrid(_CORNERS_OF_LAWS, -_FALLS, np.append(0.0, _SIZES), indexing="ij")
        shapes = 1.0 + sizes[..., None] * _above_second(self.single, corners[..., None], falls[..., None])
        powers = self.powers[self.single - 1]
        levels = (powers / shapes).mean(axis=3)
        likely = -np.log(levels[..., None] * shapes).sum(axis=3)
        likely = np.exp(likely - likely.max()) * np.where(corners > 0.0, _FLAT_BELOW, 1.0)
        kept = likely > _NEVER
        return likely[kept] / likely[kept].sum(), levels[kept], sizes[kept], corners[kept], falls[kept]

    def half_width_at(self, n: int) -> float:
        """Return the half-width that holds 95 % of an order whose cofactor is 1."""
        from scipy.special import erf

        if not self.humps:
            return student(self.freedom) * math.sqrt(self.level)
        likely, levels, sizes, corners, falls = self._laws
        sd = np.sqrt(2.0 * levels * (1.0 + sizes * _above_second(n, corners, falls)))
        below, above = 0.0, _FAR * float(sd.max())
        while above - below > _CLOSE * above:
            middle = 0.5 * (below + above)
            held = float(likely @ erf(middle / sd))
            below, above = (middle, above) if held < CONFIDENCE else (below, middle)
        return above

    def variance_at(self, n: int) -> tuple[float, float]:
        """Return the variance at an order and its degrees of freedom, by the least certain of the spectra."""
        found = [
            (variance, min(freedom, self.freedom)) for variance, freedom in (h.variance_at(n) for h in self.humps)
        ]
        return max(found, key=lambda each: student(each[1]) ** 2 * each[0], default=(self.level, self.freedom))


def _above_second(n: ArrayLike, corners: Floats, falls: Floats) -> Floats:
    """Return (1 + (n / n0)^2)^-q, of that at the second order; `falls` are -q."""
    return floats(((corners**2 + np.square(n)) / (corners**2 + _SECOND**2)) ** falls)


def noise_spectrum(angle_deg: Floats, left: Floats, fitted: Sequence[int], parameters: int) -> NoiseSpectrum:
    """Return the residual spectrum of a fit of the orders `fitted`; both have shape (M,), angles in any order.

    `parameters` is how many parameters were fitted.
    """
    freedom = float(left.size - parameters)
    level = float(left @ left) / freedom
    powers = _powers(angle_deg, left, max(HIGHEST_ORDER, max(fitted) + _BEYOND))
    white = NoiseSpectrum(level=level, freedom=freedom, powers=powers)
    orders = np.setdiff1d(np.arange(1, powers.size + 1), np.array(fitted))
    if orders.size < _LEAST_ORDERS or level <= 0.0:
        return white
    single = orders[~_lines(powers[orders - 1])]
    lines = _lines(powers[orders - 1]) & _lines(powers[orders - 1] * orders.astype(np.float64) ** _STEEPEST)
    judged, counts, places = _with_the_rest(powers, single, orders, freedom, level, angle_deg.size)
    return replace(white, humps=_humps(level, judged / level, counts, places), single=orders[~lines])


def _powers(angle_deg: Floats, left: Floats, highest: int) -> Floats:
    """Return the power at the orders from 1; an order above half the number of points is an alias."""
    places = np.unique(np.round(angle_deg % 360.0, 6)).size
    turn = np.exp(-1j * np.radians(angle_deg))
    turning = np.ones_like(turn)
    found = []
    for _ in range(min(highest, (places - 1) // 2)):
        turning *= turn
        found.append(abs(complex(left @ turning)) ** 2 / left.size)
    return np.array(found, dtype=np.float64)


def _lines(powers: Floats) -> NDArray[np.bool_]:
    """Return which powers are far above their neighbours."""
    places = np.arange(powers.size)
    width = min(2 * _NEIGHBOURS + 1, powers.size)
    firsts = np.clip(places - _NEIGHBOURS, 0, powers.size - width)
    others = np.arange(width) != (places - firsts)[:, None]
    beside = np.lib.stride_tricks.sliding_window_view(powers, width)[firsts][others].reshape(-1, width - 1)
    return np.asarray(powers > _LINE * np.median(beside, axis=1))


def _with_the_rest(
    powers: Floats, single: NDArray[np.int_], orders: NDArray[np.int_], freedom: float, level: float, points: int
) -> tuple[Floats, Floats, Floats]:
    """Return powers, how many each stands for, and their orders; the last combines all orders not taken singly."""
    counts = np.ones(single.size)
    rest = 0.5 * freedom - orders.size
    energy = 0.5 * level * freedom - float(powers[orders - 1].sum())
    if rest < 1.0 or energy <= 0.0:
        return powers[single - 1], counts, single.astype(np.float64)
    middle = math.sqrt(powers.size * 0.5 * points)
    judged = np.append(powers[single - 1], energy / rest)
    return judged, np.append(counts, rest), np.append(single.astype(np.float64), middle)


def _humps(level: float, judged: Floats, counts: Floats, places: Floats) -> tuple[Hump, ...]:
    """Return the likeliest hump of each steepness that is about as likely as the best; none if white."""
    corners = np.geomspace(0.5, places.max(), _CORNERS)
    humps = np.concatenate([[0.0], np.geomspace(0.1, _MOST_HUMP, _HUMPS)])
    falls = np.array([(1.0 + (places / corners[:, None]) ** 2) ** -steep for steep in _STEEPNESS])
    shapes = 1.0 + humps[:, None] * falls[:, :, None, :]
    levels = (counts * judged / shapes).sum(axis=3) / counts.sum()
    likelihood = -(counts * np.log(levels[..., None] * shapes)).sum(axis=3)
    best = float(likelihood.max())
    if best - float(likelihood[0, 0, 0]) < _COLOURED:
        return ()
    found = []
    for place, steepness in enumerate(_STEEPNESS):
        corner, hump = np.unravel_index(int(likelihood[place].argmax()), likelihood[place].shape)
        if likelihood[place, corner, hump] >= best - _AS_LIKELY:
            size, order = float(humps[hump]), float(corners[corner])
            slopes = _shape(places, size, order, steepness)[1]
            information = (slopes * counts) @ slopes.T + np.diag([0.0, _PRIOR, _PRIOR])
            own = level * float(levels[place, corner, hump])
            covariance = floats(np.linalg.inv(information))
            found.append(Hump(level=own, size=size, corner=order, steepness=steepness, covariance=covariance))
    return tuple(found)


def _shape(orders: Floats, hump: float, corner: float, steepness: float) -> tuple[Floats, Floats]:
    """Return S / s^2 at orders, and the slopes of ln S by (ln s^2, ln b, ln n0); shapes (K,) and (3, K)."""
    square = (orders / corner) ** 2
    own = hump / (1.0 + square) ** steepness
    shape = 1.0 + own
    fraction = own / shape
    return shape, np.stack([np.ones_like(shape), fraction, fraction * 2.0 * steepness * square / (1.0 + square)])
