"""How much the tool is behind the lobe of a part, how well that is known, and how much the part allows."""

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
"""Share of the roundness tolerance that the phase alone may use: a servo by its model leaves 0.5 of 5 um of 55."""

MEASURABLE_UM = 2.0
"""Less than this is promised of no part, and told of none: um peak to peak."""

SURE = 2.0
"""So many standard deviations of the fit make up what an error is known to: 19 of 20 are within."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """By how many spindle degrees the tool is behind the wanted path, and to how many that is known."""

    error_deg: float
    within_deg: float


def phase_of(looks: NDArray[np.float64], target: LobedPath) -> Phase | None:
    """Return how far the tool is behind `target`.

    `looks` has rows of spindle angle (deg) and infeed (um). The best sine of the lobe's order through the looks
    (least squares) is compared with the wanted one; None with too few looks, or without a lobe. What the sine
    leaves of the looks says how well its phase is known.
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
    the peak-to-peak height 2 * A * 2 * sin(N * dphi / 2): 2.9 um of 55 at 1 degree and three lobes. The limit is
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
    """Return whether the phase may be within its limit, by how well it is known; None where it is not known.

    What is known worse than to the limit is no noise: such a tool does not follow the lobe, and that excuses no
    more than the limit once again.
    """
    if phase is None:
        return None
    return limit_deg is None or abs(phase.error_deg) - min(phase.within_deg, limit_deg) <= limit_deg
