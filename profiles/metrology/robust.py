"""Find points that do not belong to the part, such as chips and scratches, report them and leave them out.

Huber weights (1 within 1.345 sigma, falling with the distance beyond) limit the influence of such points on the
harmonics; sigma is 1.4826 times the median of the absolute residuals. Points further off than `FAR_SIGMA` are
suspect, and the results come from a second least squares fit without them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats
from profiles.least_squares import harmonic_columns, huber_distances
from profiles.metrology.harmonics import HIGHEST_HARMONIC
from profiles.problem import refused

FAR_SIGMA = 4.5
"""A harmonic between the fitted ones has its maxima at 1 sigma / 0.95; of 3600 Gaussian points 0.02 lie beyond."""
LARGEST_SHARE = 0.1
_SETTLED = 1e-3
# Fraction of the peak-to-peak value below which a residual is arithmetic rounding.
_ROUNDING = 1e-9


def suspects(angle_deg: Floats, deviation_um: Floats) -> NDArray[np.bool_]:
    """Return which points are suspect; shape (M,).

    Raises `ProfileError`: `trace.outliers`, they are more than `LARGEST_SHARE` of all: then the part is rough, not
    dirty.
    """
    orders = range(1, min(HIGHEST_HARMONIC, (angle_deg.size - 1) // 4) + 1)
    columns = harmonic_columns(np.radians(angle_deg), orders)
    least_um = _ROUNDING * float(np.ptp(deviation_um))
    found = huber_distances(columns, deviation_um, np.ones_like(deviation_um), least_um, _SETTLED) > FAR_SIGMA
    if found.mean() > LARGEST_SHARE:
        value, limit = f"{100 * found.mean():.0f} %", f"<= {100 * LARGEST_SHARE:g} %"
        raise refused("trace.outliers", value=value, limit=limit)
    return found


def filled(angle_deg: Floats, profile_um: Floats, missing: NDArray[np.bool_]) -> Floats:
    """Return the profile with missing points interpolated linearly, for a filter that needs every angle."""
    kept = ~missing
    result = profile_um.copy()
    result[missing] = np.interp(angle_deg[missing], angle_deg[kept], profile_um[kept], period=360.0)
    return result
