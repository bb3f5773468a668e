"""How a controller reads the coefficients of a notch filter, told from the step of a health test with one.

From the beginning of the step to where the tool turns round it slides one way, so that dry friction is a constant
force. That force is unknown, and so is what friction held before; with each reading the step is computed, and
the force fitted that explains most of the rest. The reading fits that leaves least, if it leaves clearly less than
each other one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Floats
from profiles.axis.notch import Reading
from profiles.axis.sampled_loop import SampledLoop
from profiles.axis.step_figures import modelled

CLEARLY = 1.5  # times what the best reading leaves the next one has to leave
LEAST_LEFT = 0.004  # of the step: less is not told from noise and rounding
MOST_LEFT = 0.05  # of the step, rms: a test that leaves more is not of this axis
_MOVED = 0.002  # of the step, by which its beginning shows in the reference
_LONGEST_MS = 60.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GatheredStep:
    """A step as it was gathered, sample by sample."""

    reference_um: Floats
    position_um: Floats
    step_um: float


def left_by(loop: SampledLoop, test: GatheredStep) -> Mapping[Reading, float]:
    """Return what each reading leaves of a step: rms over its size, with the force that leaves least."""
    return {reading: _left(loop, test, reading) for reading in Reading}


def reading_of(left: Mapping[Reading, float]) -> Reading | None:
    """Return the reading that a test shows; None where two are too much alike."""
    first, second = sorted(left, key=lambda each: left[each])[:2]
    return first if left[second] >= CLEARLY * max(left[first], LEAST_LEFT) else None


def _left(loop: SampledLoop, test: GatheredStep, reading: Reading) -> float:
    from scipy.signal import lfilter

    read = replace(loop, gains=replace(loop.gains, notch=loop.gains.notch.read_as(reading)))
    begin, end = _one_way(loop, test)
    with np.errstate(all="ignore"):
        off = (test.position_um - modelled(read, test.reference_um))[begin:end]
        pushed = lfilter(*read.force_polynomials(), np.ones(end - begin))
        size = float(pushed @ pushed)
        force = float(off @ pushed) / size if np.isfinite(size) and size else 0.0
        found = float(np.sqrt(np.mean((off - force * pushed) ** 2))) / test.step_um
    return found if np.isfinite(found) else np.inf


def _one_way(loop: SampledLoop, test: GatheredStep) -> tuple[int, int]:
    """Return the samples from the beginning of the step to where the tool first turns round."""
    moved = np.abs(test.reference_um - test.reference_um[0]) > _MOVED * test.step_um
    begin = int(np.argmax(moved))
    most = begin + max(int(_LONGEST_MS / 1000.0 / loop.period_s), 2)
    way = np.sign(test.reference_um[-1] - test.reference_um[0]) * test.position_um[begin:most]
    return begin, begin + max(int(np.argmax(way)), 2)
