"""Learn two numbers per harmonic: from the tool in air, from the tool in the cut, from the measured part.

A harmonic of order n (UPR) is a complex coefficient c in um: Re(c exp(j n angle)), angle from the spindle's
index. Tool motion is positive into the work, a part's deviation positive outwards, an error target minus
actual. The tool is learned from its own encoder: U <- U + gain E / T, with U the command, E the error and T the
nominal response. The error shrinks by |1 - gain T' / T| a pass, T' the true response; below 1 it converges
(iterative learning control in the frequency domain, Bristow, Tharayil and Alleyne 2006). The part is learned
from the gauge: where it stands high, the target goes deeper, W <- W + gain R.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import floats
from profiles.compensations.path import CutPath
from profiles.least_squares import fit, harmonic_columns, phasors
from profiles.problem import refused

SIGNIFICANT = 2.45
"""Standard deviations above which a harmonic is significant: 95 %, chi-square with two degrees of freedom."""

STEADY_SHARE = 0.02
"""Below this reciprocal condition number the angles cannot separate the harmonics."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicFit:
    """Harmonics found in samples: the mean, coefficients by order, and the residual.

    `amplitude_sd_um` is the standard deviation of each amplitude if the residual is white, `rest_rms_um` that
    of the residual itself.
    """

    mean_um: float
    coefficients_um: Mapping[int, complex]
    amplitude_sd_um: float
    rest_rms_um: float

    def significant(self) -> dict[int, complex]:
        """Return the coefficients above the noise."""
        least = SIGNIFICANT * self.amplitude_sd_um
        return {n: c for n, c in self.coefficients_um.items() if abs(c) > least}


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """A deviation in um: its mean, and harmonics by order."""

    mean_um: float = 0.0
    coefficients_um: Mapping[int, complex]


def fit_harmonics(angle_deg: ArrayLike, values_um: ArrayLike, orders: Sequence[int]) -> HarmonicFit:
    """Fit mean and harmonics of `orders` by least squares; both inputs have shape (M,), angles in any order.

    Raises `ProfileError`: `learning.few_samples`, or angles that cannot separate the harmonics.
    """
    angle = np.radians(floats(angle_deg))
    values = floats(values_um)
    unknowns = 1 + 2 * len(orders)
    if values.size <= 2 * unknowns:
        raise refused("learning.few_samples", value=str(values.size), limit=f"> {2 * unknowns}")
    found = fit(harmonic_columns(angle, orders), values)
    if found.condition * STEADY_SHARE > 1.0:
        gap = f"{math.degrees(float(np.ptp(angle))):.3g} deg"
        raise refused("learning.few_samples", key="angle_deg", value=gap, limit=">= 360 deg")
    return HarmonicFit(
        mean_um=float(found.coefficients[0]),
        coefficients_um=phasors(found.coefficients, orders),
        amplitude_sd_um=math.sqrt(2.0 * found.variance / values.size),
        rest_rms_um=found.residual_sd,
    )


def learned_command(
    path: CutPath, error_um: Mapping[int, complex], response: Callable[[int], complex], gain: float = 1.0
) -> CutPath:
    """Return the path with a command that removes the tool's error (target minus actual).

    `response` is the nominal one from command to tool, by order.
    """
    change = {n: gain * error / response(n) for n, error in error_um.items()}
    return CutPath(target=path.target, command=path.command.plus(change))


def learned_part(
    path: CutPath, part: Deviation, tool: Deviation, response: Callable[[int], complex], gain: float = 1.0
) -> CutPath:
    """Return the path for the next part, after one that deviates by `part` while the tool was off by `tool`.

    Both are positive where the part stands high or the tool was not deep enough. The tool's deviation corrects
    the command alone; the rest corrects the target, and the command follows by the nominal response.
    """
    target = {n: gain * (c - tool.coefficients_um.get(n, 0j)) for n, c in part.coefficients_um.items()}
    mean_um = gain * (part.mean_um - tool.mean_um)
    told = {
        n: (target.get(n, 0j) + tool.coefficients_um.get(n, 0j)) / response(n)
        for n in (*target, *tool.coefficients_um)
    }
    return CutPath(
        target=path.target.plus(target, mean_um), command=path.command.plus(told, mean_um + tool.mean_um)
    )


def convergence(true: complex, nominal: complex, gain: float = 1.0) -> float:
    """Return |1 - gain T' / T|, the factor of an error per pass; it converges below 1."""
    return abs(1.0 - gain * true / nominal)


def trimmed(trim_um: complex, error_um: complex, response: complex, gain: float, most_um: float) -> complex:
    """Return the next trim of a running cut: adaptive feedforward cancellation, once per batch of samples.

    Raises `ProfileError`: `learning.trim_limit`; the trim that is in effect stays.
    """
    target = trim_um + gain * error_um / response
    if not abs(target) <= most_um:
        raise refused("learning.trim_limit", value=f"{abs(target):.2f} um", limit=f"<= {most_um:g} um")
    return target
