"""The undulations of a profile, fitted together for any angles, and points that do not belong to the part.

Huber weights (1 within 1.345 sigma, falling with the distance beyond) limit the influence of chips and scratches
on the harmonics; sigma is 1.4826 times the median of the absolute residuals. Points further off than `FAR_SIGMA`
are suspect, and the results come from a second least squares fit without them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats
from profiles.least_squares import fit, harmonic_columns, huber_distances, phasors
from profiles.problem import refused

HIGHEST_HARMONIC = 15
# Above this ratio of singular values the angles leave a gap in which harmonics cannot be separated.
_WORST_CONDITION = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Harmonic:
    """amplitude cos(n (angle - phase)), with `phase_deg` the first maximum, in [0, 360/n)."""

    n: int
    amplitude_um: float
    phase_deg: float

    def past_jaw_1_deg(self, jaw_1_deg: float, *, against_spindle: bool = False) -> float:
        """Return the angle of its first maximum past jaw 1 as the spindle counts, in [0, 360/n).

        `jaw_1_deg` is where jaw 1 is in the angles of the trace; `against_spindle` says that these run the other
        way round the part than the angles of the spindle.
        """
        past_deg = self.phase_deg - jaw_1_deg
        return _first_deg(-past_deg if against_spindle else past_deg, self.n)


def harmonics(angle_deg: Floats, profile_um: Floats) -> tuple[Harmonic, ...]:
    """Fit n = 1 to 15 together, or fewer where the points cannot separate them; return those from 2."""
    for highest in range(min(HIGHEST_HARMONIC, (angle_deg.size - 1) // 2), 1, -1):
        orders = range(1, highest + 1)
        found = fit(harmonic_columns(np.radians(angle_deg), orders), profile_um)
        if found.condition <= _WORST_CONDITION:
            waves = phasors(found.coefficients, orders)
            return tuple(harmonic(n, c.real, -c.imag) for n, c in waves.items() if n > 1)
    return ()


def harmonic(n: int, cosine_um: float, sine_um: float) -> Harmonic:
    """Return cosine cos(n angle) + sine sin(n angle) as amplitude and first maximum."""
    phase_deg = _first_deg(math.degrees(math.atan2(sine_um, cosine_um)) / n, n)
    return Harmonic(n=n, amplitude_um=math.hypot(cosine_um, sine_um), phase_deg=phase_deg)


def _first_deg(phase_deg: float, n: int) -> float:
    first_deg = phase_deg % (360 / n)
    # The remainder of a tiny negative number rounds up to the divisor.
    return 0.0 if first_deg >= 360 / n else first_deg


FAR_SIGMA = 4.5
"""A harmonic between the fitted ones has its maxima at 1 sigma / 0.95; of 3600 Gaussian points 0.02 lie beyond."""
LARGEST_FRACTION = 0.1
_SETTLED = 1e-3
_ROUNDING = 1e-9  # fraction of the peak-to-peak value below which a residual is arithmetic rounding


def suspects(angle_deg: Floats, deviation_um: Floats) -> NDArray[np.bool_]:
    """Return which points are suspect; shape (M,).

    Raises `ProfileError`: `trace.outliers`, they are more than `LARGEST_FRACTION` of all: then the part is rough,
    not dirty.
    """
    orders = range(1, min(HIGHEST_HARMONIC, (angle_deg.size - 1) // 4) + 1)
    columns = harmonic_columns(np.radians(angle_deg), orders)
    least_um = _ROUNDING * float(np.ptp(deviation_um))
    found = huber_distances(columns, deviation_um, np.ones_like(deviation_um), least_um, _SETTLED) > FAR_SIGMA
    if found.mean() > LARGEST_FRACTION:
        value, limit = f"{100 * found.mean():.0f} %", f"<= {100 * LARGEST_FRACTION:g} %"
        raise refused("trace.outliers", value=value, limit=limit)
    return found


def filled(angle_deg: Floats, profile_um: Floats, missing: NDArray[np.bool_]) -> Floats:
    """Return the profile with missing points interpolated linearly, for a filter that needs every angle."""
    kept = ~missing
    result = profile_um.copy()
    result[missing] = np.interp(angle_deg[missing], angle_deg[kept], profile_um[kept], period=360.0)
    return result
