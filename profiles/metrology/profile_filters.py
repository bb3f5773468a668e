"""Filters of a closed profile beside the Gaussian: spline, robust Gaussian, and the electrical one of old gauges.

Profiles are equally spaced, in the order of their angles, um, shape (M,); cut-offs n_c in undulations per
revolution (UPR). All are low-passes.

- spline (ISO 16610-22, linear, without tension): (1 + alpha^4 Q) w = z, Q the square of the periodic second
  difference, alpha = 1 / (2 sin(pi n_c / M)). It passes 1 / (1 + (sin(pi n / M) / sin(pi n_c / M))^4), a half
  at n_c.
- robust (ISO 16610-31, Gaussian regression of degree 2): about each point a parabola is fitted with the weights
  exp(-pi (x / (alpha lambda_c))^2), alpha = 0.7309, times those of Tukey, (1 - (r / c)^2)^2 within c = 4.4478
  medians of the absolute residuals |r|, else 0; repeated until c settles. A scratch does not draw the line to it.
  Without one it passes (1 + s) exp(-s), s = pi (alpha n / n_c)^2: a half at n_c.
- 2rc (ISO 3274:1975, ISO 4291:1985): two RC stages, 1 / (1 + j n / (sqrt(3) n_c))^2, 75 % at n_c. It lags: the
  profile comes later in the direction of rising angles.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats, floats
from profiles.metrology.points import gaussian_filter, gaussian_transmission
from profiles.problem import refusal_error


class FilterKind(StrEnum):
    """The filters of a profile."""

    GAUSS = "gauss"
    SPLINE = "spline"
    ROBUST = "robust"
    TWO_RC = "2rc"


ALPHA = 0.7309  # of the weights of a regression of degree 2: (1 + s) exp(-s) is one half at the cut-off
TUKEY = 4.4478  # medians of the absolute residuals beyond which a point has no weight: 3 sigma of white noise
_SETTLED = 1e-6  # relative change of the limit at which it has (choice)
_MOST_ROUNDS = 100
_SMOOTH = (
    1e-6  # fraction of the peak to valley: with a smaller limit the profile is all form, and nothing is left out
)
_LEAST_TRUST = 1e-6  # of any point: where no other is near, in a feature wider than the weights, it is the line


def filter_profile(
    profile_um: ArrayLike, kind: FilterKind, cutoff_upr: float, above_upr: float | None = None
) -> Floats:
    """Return a profile through the low-pass; with `above_upr` what passes it and not the one there.

    Raises `ProfileError`: `value.out_of_range`, as `gaussian_filter`, or above half of the points.
    """
    profile = floats(profile_um)
    gaussian = gaussian_filter(profile, cutoff_upr, above_upr=above_upr)  # it refuses what no filter can do
    if kind is FilterKind.GAUSS:
        return gaussian
    low = _low_pass(profile, kind, cutoff_upr)
    return low if above_upr is None else low - _low_pass(profile, kind, above_upr)


def transmission(
    kind: FilterKind, undulations: ArrayLike, cutoff_upr: float, points: int
) -> NDArray[np.complex128]:
    """Return the complex transmission of `points` at equal angles; of the robust filter without outliers."""
    n = floats(undulations)
    passed: NDArray[Any]
    if kind is FilterKind.SPLINE:
        passed = 1.0 / (1.0 + (np.sin(math.pi * n / points) / math.sin(math.pi * cutoff_upr / points)) ** 4)
    elif kind is FilterKind.ROBUST:
        s = math.pi * (ALPHA * n / cutoff_upr) ** 2
        passed = (1.0 + s) * np.exp(-s)
    elif kind is FilterKind.TWO_RC:
        passed = 1.0 / (1.0 + 1j * n / (math.sqrt(3.0) * cutoff_upr)) ** 2
    else:
        passed = gaussian_transmission(n, cutoff_upr)
    return np.asarray(passed, dtype=np.complex128)


def _low_pass(profile: Floats, kind: FilterKind, cutoff_upr: float) -> Floats:
    if kind is FilterKind.ROBUST:
        return _robust(profile, cutoff_upr)
    if kind is FilterKind.SPLINE and cutoff_upr > profile.size / 2:
        value, limit = f"{cutoff_upr:g}", f"<= {profile.size / 2:g} UPR"
        raise refusal_error("value.out_of_range", key="filter_upr", value=value, limit=limit)
    spectrum = np.fft.rfft(profile)
    return np.fft.irfft(
        spectrum * transmission(kind, np.arange(spectrum.size), cutoff_upr, profile.size), profile.size
    )


def _robust(profile: Floats, cutoff_upr: float) -> Floats:
    """Return the mean line of the robust Gaussian regression."""
    count = profile.size
    # Distances in cut-off wavelengths, so that the powers of the normal equations are of one size.
    apart = (np.mod(np.arange(count) + count // 2, count) - count // 2) * (cutoff_upr / count)
    weights = np.exp(-math.pi * (apart / ALPHA) ** 2)
    kernels = [np.fft.rfft(weights * apart**power) for power in range(5)]
    trust, limit_um, line = np.ones(count), math.inf, profile
    smooth_um = _SMOOTH * float(np.ptp(profile))
    for _ in range(_MOST_ROUNDS):
        line = _regression(profile, trust, kernels)
        size = np.abs(profile - line)
        before, limit_um = limit_um, TUKEY * float(np.median(size))
        if limit_um <= smooth_um or abs(before - limit_um) <= _SETTLED * limit_um:
            break
        trust = np.maximum(np.clip(1.0 - (size / limit_um) ** 2, 0.0, None) ** 2, _LEAST_TRUST)
    return line


def _regression(profile: Floats, trust: Floats, kernels: list[NDArray[np.complex128]]) -> Floats:
    """Return the value of the weighted parabola about each point; `kernels` are moments of the weights."""
    count = profile.size
    known, read = np.fft.rfft(trust), np.fft.rfft(trust * profile)
    moments = [np.fft.irfft(known * kernel.conj(), count) for kernel in kernels]
    sides = np.stack([np.fft.irfft(read * kernel.conj(), count) for kernel in kernels[:3]], axis=-1)
    normal = np.stack([np.stack(moments[row : row + 3], axis=-1) for row in range(3)], axis=-2)
    return floats((np.linalg.pinv(normal, hermitian=True) @ sides[..., None])[:, 0, 0])
