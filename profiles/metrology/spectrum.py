"""The spectrum of a closed profile: what each number of undulations per revolution contributes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats
from profiles.metrology.points import checked, equally_spaced


def spectrum_um_pp(angle_deg: ArrayLike, profile_um: ArrayLike) -> Floats:
    """Return peak to peak um of each order, shape (M // 2 + 1,), index 0 for the mean.

    M points at equal angles, in any order; an empty array for unequal ones, whose orders are not separate.
    Raises as `profiles.metrology.points.checked`.
    """
    angle, profile = checked(angle_deg, profile_um)
    if not equally_spaced(angle):
        return np.zeros(0)
    amplitude = 2.0 / profile.size * np.abs(np.fft.rfft(profile[np.argsort(np.mod(angle, 360.0), kind="stable")]))
    amplitude[0] /= 2.0
    return np.asarray(2.0 * amplitude, dtype=np.float64)
