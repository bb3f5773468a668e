"""The points of a closed profile: validity, spacing round the turn, weights, and its Gaussian filter.

Angles in degrees, in any order and from any start; deviations in um, positive outwards; shape (M,) each.

The filter is after ISO 16610-21, by the spectrum, so without end effects. Cut-offs are in undulations per
revolution (UPR): there the transmission is one half.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.problem import Problem, ProfileError, refusal_error

FEWEST_POINTS = 4
HANDFUL = 32  # fewer points than this are not a profile: nothing is known between them
LARGEST_GAP_DEG = 60.0  # half the period of a three-lobe, maximum to minimum: a larger gap can hide all of it
# Fraction of a step by which the angles of an equally spaced trace may be off, e.g. by rounding in a file.
_SPACING_TOLERANCE = 0.01
_GAP_TOLERANCE_DEG = 1e-6
_TURN_DEG = 360.0
POINTS_PER_UNDULATION = 7
_ALPHA = math.sqrt(math.log(2) / math.pi)  # sqrt(ln 2 / pi): the transmission at the cut-off is one half


def check_points(angle_deg: ArrayLike, deviation_um: ArrayLike) -> tuple[Floats, Floats]:
    """Return both as arrays of shape (M,).

    Raises `ProfileError`: `trace.columns`, `trace.few_points`, `trace.not_finite`; `trace.narrow_angles`, there is
    a gap above `LARGEST_GAP_DEG`.
    """
    angle = floats(angle_deg)
    deviation = floats(deviation_um)
    if angle.ndim != 1 or angle.shape != deviation.shape:
        value = f"{angle.shape} {deviation.shape}"
        raise refusal_error("trace.columns", value=value, limit="(M,) (M,)")
    if angle.size < FEWEST_POINTS:
        raise refusal_error("trace.few_points", value=str(angle.size), limit=f">= {FEWEST_POINTS}")
    for key, values in (("angle_deg", angle), ("deviation_um", deviation)):
        if not np.isfinite(values).all():
            value = f"{values[~np.isfinite(values)][0]:g}"
            raise refusal_error("trace.not_finite", key=key, value=value)
    gap_deg = largest_gap_deg(angle)
    if gap_deg > LARGEST_GAP_DEG + _GAP_TOLERANCE_DEG:
        raise ProfileError(narrow(gap_deg, LARGEST_GAP_DEG))
    return angle, deviation


def narrow(gap_deg: float, most_deg: float) -> Problem:
    """Return the refusal of angles with such a gap."""
    value, limit = f"{gap_deg:g} deg", f"<= {most_deg:g} deg"
    return Problem(code="trace.narrow_angles", key="angle_deg", value=value, limit=limit)


def equally_spaced(angle_deg: ArrayLike) -> bool:
    """Return whether the angles, in any order and from any start, divide the turn into equal steps."""
    gaps = _gaps_deg(angle_deg)
    step = _TURN_DEG / gaps.size
    return bool(np.all(np.abs(gaps - step) <= _SPACING_TOLERANCE * step))


def largest_gap_deg(angle_deg: ArrayLike) -> float:
    """Return the largest step between neighbouring angles, in any order and from any start."""
    return float(_gaps_deg(angle_deg).max())


def angle_weights(angle_deg: Floats) -> Floats:
    """Return the angle that each point stands for, half the gaps on both sides, over the mean one; shape (M,).

    So sums over points are integrals round the turn, however densely a part of it was scanned. Equal steps and
    fewer than `HANDFUL` points, which are no profile, have 1.
    """
    if angle_deg.size < HANDFUL or equally_spaced(angle_deg):
        return np.ones(angle_deg.size)
    turned = np.mod(angle_deg, _TURN_DEG)
    order = np.argsort(turned, kind="stable")
    gaps = _gaps_deg(angle_deg)
    weights = np.empty(angle_deg.size)
    weights[order] = (gaps + np.roll(gaps, 1)) * (0.5 * angle_deg.size / _TURN_DEG)
    return weights


def largest_gap(angle_deg: Floats) -> tuple[float, float, float]:
    """Return where the largest step begins, its size and that of the median step, deg."""
    gaps = _gaps_deg(angle_deg)
    worst = int(np.argmax(gaps))
    return float(np.sort(np.mod(angle_deg, _TURN_DEG))[worst]), float(gaps[worst]), float(np.median(gaps))


def _gaps_deg(angle_deg: ArrayLike) -> Floats:
    angle = floats(angle_deg)
    if angle.min() < 0.0 or angle.max() >= _TURN_DEG:
        angle = np.mod(angle, _TURN_DEG)
    angle = np.sort(angle)
    return np.diff(angle, append=angle[0] + _TURN_DEG)


def gaussian_transmission(undulations: ArrayLike, cutoff_upr: float) -> Floats:
    """Return exp(-pi (alpha n / n_c)^2), the low-pass of ISO 16610-21: one half at the cut-off."""
    n = floats(undulations)
    return floats(np.exp(-math.pi * (_ALPHA * n / cutoff_upr) ** 2))


def gaussian_weights(apart: Floats, cutoff: float) -> Floats:
    """Return the weights, at distances in the unit of the cut-off, of the low-pass that passes half of it."""
    return floats(np.exp(-math.pi * (apart / (_ALPHA * cutoff)) ** 2))


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
            raise refusal_error("value.out_of_range", key="above_upr", value=f"{above_upr:g}", limit=limit)
        passed = passed - gaussian_transmission(n, above_upr)
    return np.fft.irfft(spectrum * passed, profile.size)


def _require_positive(cutoff_upr: float, key: str) -> None:
    if not (math.isfinite(cutoff_upr) and cutoff_upr > 0):
        raise refusal_error("value.out_of_range", key=key, value=f"{cutoff_upr:g}", limit="> 0 UPR")
