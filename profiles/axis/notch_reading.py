"""How a controller reads the coefficients of a notch filter, told from a health test with one in the loop.

The step of the test is computed with each reading, and so is the response at its sine. The reading fits that
leaves least, if it leaves clearly less than each other one: what friction does to a test it does under every
reading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Floats, floats
from profiles.axis.notch import Reading
from profiles.axis.sampled_loop import SampledLoop
from profiles.axis.step_figures import modelled

CLEARLY = 1.5  # times what the best reading leaves the next one has to leave
MOST_LEFT = 0.25  # of the step and of the response, together; 3 N of dry friction leave some 0.15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GatheredStep:
    """A step as it was gathered, sample by sample, with the response at one frequency."""

    reference_um: Floats
    position_um: Floats
    step_um: float
    sine_hz: float
    sine: complex


def left_by(loop: SampledLoop, test: GatheredStep) -> Mapping[Reading, float]:
    """Return what each reading leaves of a test: rms over the step and relative at the sine, as one number."""
    return {reading: _left(loop, test, reading) for reading in Reading}


def reading_of(left: Mapping[Reading, float]) -> Reading | None:
    """Return the reading that a test shows; None where two are too much alike."""
    first, second = sorted(left, key=lambda each: left[each])[:2]
    return first if left[second] >= CLEARLY * left[first] else None


def _left(loop: SampledLoop, test: GatheredStep, reading: Reading) -> float:
    gains = replace(loop.gains, notch=loop.gains.notch.read_as(reading))
    read = replace(loop, gains=gains)
    with np.errstate(all="ignore"):
        off = test.position_um - modelled(read, test.reference_um)
        step = float(np.sqrt(np.mean(off**2))) / test.step_um
        response = complex(read.closed(floats([test.sine_hz]))[0])
    found = float(np.hypot(step, abs(test.sine / response - 1.0)))
    return found if np.isfinite(found) else np.inf
