"""Speed ripple of the spindle within a turn, from samples of its angle and its following error.

Not from the times of the samples. A sample was taken somewhere between request and reply: 5 ms are 30 deg at
1000 rpm, and a speed that swings by 1 % twice a turn moves the angle by 0.29 deg. From 240 samples a ripple could
be determined to some 90 %. The following error comes with the angle in one reply, and while the controller
commands an even speed it is the ripple itself, to a count of the encoder. A ms between the two only turns the
ripple by some degrees. A spindle not driven by the controller has no following error, and no ripple is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profiles.least_squares import fit, harmonic_columns

Floats = NDArray[np.float64]

ORDERS = range(1, 7)
"""Ripple harmonics per revolution that are fitted: belts, jaws, gears, poles. Faster ones are left out."""

LEAST_LOOKS = 40
"""Nearly three times the number of unknowns in the fit."""

WITHIN_LIMIT_PERCENT = 1.0
"""A ripple with a larger uncertainty than this is not reported."""

LEAST_SPREAD = 0.05
"""Smallest over largest singular value of the fit; below it the samples are too close together in the turn."""

DEVIATIONS = 7.0
"""Standard errors by which chance may spoil the figure: 3.5 at the fastest place of a turn, which is sought among
all of them, and as many at the slowest."""

_PLACES = 2.0 * np.pi * np.arange(180) / 180


@dataclass(frozen=True, slots=True)
class SpindleRipple:
    """Peak to peak of the speed within a turn over its mean, and its uncertainty, both in percent."""

    percent: float
    within_percent: float


def spindle_ripple(looks: Floats, counts_per_rev: float) -> SpindleRipple | None:
    """Return the ripple of the speed over the angle, None where its uncertainty exceeds `WITHIN_LIMIT_PERCENT`.

    `looks` has rows of position and following error, counts, of a spindle that is commanded to turn evenly. Its
    lead is fitted over the angle (least squares), beside a lag that may drift; the slope of that is the
    ripple of the speed. Its standard error comes from the residual; samples at too few angles of a turn are
    rejected. The rounding of the encoder is added (`_rounded`).
    """
    if len(looks) < LEAST_LOOKS:
        return None
    count_rad = 2.0 * np.pi / counts_per_rev
    angle, ahead = looks[:, 0] * count_rad, -looks[:, 1] * count_rad
    drift = (angle - angle.mean()) / max(float(np.ptp(angle)), count_rad)
    found = fit(harmonic_columns(angle, ORDERS, drift), ahead)
    if found.condition * LEAST_SPREAD >= 1.0:
        return None
    swing = _SLOPES @ found.coefficients
    error = np.sqrt(np.einsum("ij,jk,ik->i", _SLOPES, found.covariance, _SLOPES).max())
    within_percent = 100.0 * (DEVIATIONS * float(error) + _rounded(count_rad))
    if within_percent > WITHIN_LIMIT_PERCENT or swing.max() >= 1.0:
        return None
    # The ripple is over the true angle: d(true - even) / d(true), and so the speed is 1 / (1 - ripple) of the
    # mean.
    speed = 1.0 / (1.0 - swing)
    return SpindleRipple(percent=100.0 * float(np.ptp(speed)), within_percent=within_percent)


def _rounded(count_rad: float) -> float:
    """Return the ripple, peak to peak, that rounding to whole counts can make: 0.45 % for 10 000 counts a turn.

    The rounding error is a saw tooth over the counts. With evenly timed samples it may alias to one over the turn:
    its harmonics, the n-th of 1 / (n pi) counts, are then taken for ripple; at the worst the largest for the
    highest order, and so on.
    """
    worst = sum(order / harmonic for harmonic, order in enumerate(reversed(ORDERS), start=1))
    return 2.0 * worst * count_rad / np.pi


def _slopes(angle: Floats) -> Floats:
    """Return the slopes of the fit's columns over the angle; mean and drift have none."""
    pairs = ((-order * np.sin(order * angle), order * np.cos(order * angle)) for order in ORDERS)
    none = np.zeros_like(angle)
    return np.column_stack([none, none, *(slope for pair in pairs for slope in pair)])


_SLOPES = _slopes(_PLACES)
