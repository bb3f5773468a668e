"""Gaussian filters of a closed profile, after ISO 16610-21: by its spectrum, so without end effects.

Cut-offs in undulations per revolution (UPR): there the transmission is one half.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.problem import refused

POINTS_PER_UNDULATION = 7
_ALPHA = math.sqrt(math.log(2) / math.pi)  # sqrt(ln 2 / pi): the transmission at the cut-off is one half


def gaussian_transmission(undulations: ArrayLike, cutoff_upr: float) -> Floats:
    """Return exp(-pi (alpha n / n_c)^2), the low-pass of ISO 16610-21: one half at the cut-off."""
    n = floats(undulations)
    return floats(np.exp(-math.pi * (_ALPHA * n / cutoff_upr) ** 2))


def gaussian_filter(profile_um: ArrayLike, cutoff_upr: float, *, above_upr: float | None = None) -> Floats:
    """Return a closed profile, equally spaced and in the order of its angles, through the low-pass.

    With `above_upr` it is the band pass from there to the cut-off: the low-pass there is subtracted (n = 0 too).
    Raises `ProfileError`: `value.out_of_range`, a cut-off is not above 0, or the band is empty.
    """
    _require_positive(cutoff_upr, "filter_upr")
    profile = floats(profile_um)
    spectrum = np.fft.rfft(profile)
    n = np.arange(spectrum.size)
    passed = gaussian_transmission(n, cutoff_upr)
    if above_upr is not None:
        _require_positive(above_upr, "above_upr")
        if above_upr >= cutoff_upr:
            limit = f"< {cutoff_upr:g} UPR"
            raise refused("value.out_of_range", key="above_upr", value=f"{above_upr:g}", limit=limit)
        passed = passed - gaussian_transmission(n, above_upr)
    return np.fft.irfft(spectrum * passed, profile.size)


def _require_positive(cutoff_upr: float, key: str) -> None:
    if not (math.isfinite(cutoff_upr) and cutoff_upr > 0):
        raise refused("value.out_of_range", key=key, value=f"{cutoff_upr:g}", limit="> 0 UPR")
