"""The gain of a harmonic from what is known of its scatter: Kalman's, and whether a harmonic repeats at all.

What a path has to remove is one complex number of an order, nearly the same for each part. A part shows it with a
variance R, of the clamping and of the gauge. Before the first part it is known within P. The mean squared
error of the next part is least at the gain P / (P + R), after which (1 - gain) P is left of P (Kalman 1960);
to it comes what the tool may have done otherwise in this step, and what a lathe changes from part to part. Without
either the gains are 1, 1/2, 1/3, ...: the mean of all parts, while a fixed gain remembers the last ones alone.

A blank is oval at any angle: what it leaves on a part is another number each time, and the path that removes
it from one part adds it to the next. It shows as the scatter s^2 of an order over k parts: the mean m is of the
machine where |m|^2 exceeds s^2 / k by Fisher's F of 2 and 2 (k - 1) degrees of freedom. One part cannot tell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from profiles.compensations.learning import REPEATS_SD_UM

SURPRISE = 9.0
"""Over P + R: a squared error beyond that is a change of the set-up, for which what was known does not count. By
chance it is one in 8000 where noise has both directions, one in 370 where the force of a clamping has one."""

PRIOR_FRACTION = 0.07  # of the height of a lobe, as an indicator shows it on a few parts; assumed
PRIOR_DEG = 3.0  # of the angle of jaw 1, by eye or by an indicator; assumed
PROCESS_LOSS_SD = 0.1
"""Of the fraction of the tool's motion that does not arrive in the surface (it ploughs, the part gives way): most
likely none, and 20 % at two standard deviations; assumed."""

PRIOR_OTHERS_UM = 5.0  # amplitude of an order that nothing is known of: half of what a path may have of it

_CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Scatter:
    """What is known of an order, amplitudes in um: `prior_um` before the first part, `part_um` of each part.

    `response` is the standard deviation of what the tool does with a step, over the step.
    """

    prior_um: float
    part_um: float
    response: float = 0.0


def lobe_prior_um(amplitude_um: float, lobes: int) -> float:
    """Return how well a job knows its lobe: height and angle, the angle counted `lobes` times."""
    return amplitude_um * math.hypot(PRIOR_FRACTION, lobes * math.radians(PRIOR_DEG))


def optimal_gain(scatter: Scatter, steps_um: Sequence[float] = (), error_um: float = 0.0) -> float:
    """Return the gain for the next step, after `steps_um` of the path since the model, one for each part.

    `error_um` is that of the last part; if far beyond the expected scatter, it is taken as a change of its own.
    """
    variance, part = scatter.prior_um**2, scatter.part_um**2 + REPEATS_SD_UM**2
    for step_um in steps_um:  # the variance of a Kalman filter: a part tells, the step that follows it blurs
        variance *= part / (variance + part)
        variance += (scatter.response * step_um) ** 2 + REPEATS_SD_UM**2
    if error_um**2 > SURPRISE * (variance + part):
        variance = max(variance, error_um**2 - part)
    return variance / (variance + part)


def repeats(parts_um: Sequence[complex]) -> bool:
    """Whether an order of some parts has a mean that stands out of its scatter; False for fewer than two."""
    count = len(parts_um)
    if count < 2:
        return False
    mean = sum(parts_um) / count
    scatter = scatter_um(parts_um) ** 2 + REPEATS_SD_UM**2
    pairs = count - 1  # the 95 % point of Fisher's F of 2 and 2 `pairs` degrees of freedom has a closed form
    return count * abs(mean) ** 2 > pairs * (math.pow(1.0 - _CONFIDENCE, -1.0 / pairs) - 1.0) * scatter


def scatter_um(parts_um: Sequence[complex]) -> float:
    """Return the standard deviation of an order over some parts; 0 for fewer than two."""
    count = len(parts_um)
    if count < 2:
        return 0.0
    mean = sum(parts_um) / count
    return math.sqrt(sum(abs(each - mean) ** 2 for each in parts_um) / (count - 1))
