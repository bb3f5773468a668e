"""Phase lag of the tool behind the lobe of a part, its uncertainty, and the limit that the part sets."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profiles.compensations.path import LobedPath
from profiles.least_squares import fit, harmonic_columns, phasors

LEAST_LOOKS = 20

TOLERANCE_SHARE = 0.8
"""Fraction of the roundness tolerance that phase alone may use: a servo by its model leaves 0.5 of 5 um of 55."""

MEASURABLE_UM = 2.0
"""Smallest difference that can be measured on a part, um peak to peak."""

SURE = 2.0
"""Coverage factor: the uncertainty of the fit in standard deviations, 95 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """Phase lag of the tool behind the target path, spindle degrees, and its uncertainty."""

    error_deg: float
    within_deg: float


def phase_of(looks: NDArray[np.float64], target: LobedPath) -> Phase | None:
    """Return the phase lag of the tool behind `target`.

    `looks` has rows of spindle angle (deg) and infeed (um). The best sine of the lobe's order through the samples
    (least squares) is compared with the target; None with too few samples, or without a lobe. The residual gives
    the uncertainty of the phase.
    """
    if len(looks) < LEAST_LOOKS or target.amplitude_um == 0.0:
        return None
    wave = target.lobes * np.radians(looks[:, 0])
    found = fit(harmonic_columns(wave, (1,)), looks[:, 1])
    coefficient = phasors(found.coefficients, (1,))[1]
    amplitude_um = abs(coefficient)
    if amplitude_um < 0.1 * target.amplitude_um:
        return None
    behind_deg = math.degrees(-cmath.phase(coefficient)) / target.lobes - target.crest_deg
    across = np.array([0.0, coefficient.imag, coefficient.real]) / amplitude_um**2
    return Phase(
        error_deg=math.remainder(behind_deg, 360.0 / target.lobes),
        within_deg=SURE * math.degrees(found.sd_along(across)) / target.lobes,
    )


def phase_limit_deg(target: LobedPath, tolerance_um: float) -> float | None:
    """Return the limit of the phase error, spindle degrees either way; None where no phase spoils the part.

    A sine of N lobes and amplitude A that is cut dphi late leaves the difference of the two, a sine of its own, of
    peak-to-peak height 2 * A * 2 * sin(N * dphi / 2): 2.9 um of 55 at 1 degree and three lobes. The limit is
    the dphi at which that is R,

        dphi = 2 / N * asin(R / (4 * A))

    with R = 0.8 of the roundness tolerance, but never tighter than what can be measured (2 um), and never looser
    than the tolerance. Where even the opposite phase, 4 * A, leaves no more than R there is no limit: the lobe is
    nothing to the part.
    """
    residual_um = min(max(TOLERANCE_SHARE * tolerance_um, MEASURABLE_UM), tolerance_um)
    most_um = 4.0 * target.amplitude_um
    if most_um <= residual_um:
        return None
    return math.degrees(2.0 / target.lobes * math.asin(residual_um / most_um))


def is_in_phase(phase: Phase | None, limit_deg: float | None) -> bool | None:
    """Return whether the phase may be within its limit, given its uncertainty; None where it is not known.

    An uncertainty above the limit is not noise: such a tool does not follow the lobe, so the allowance is capped
    at the limit once more.
    """
    if phase is None:
        return None
    return limit_deg is None or abs(phase.error_deg) - min(phase.within_deg, limit_deg) <= limit_deg
