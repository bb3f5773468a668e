"""Figures of a servo from samples of its reference and its position: the step, and the error along a path.

The step of a health test with a notch filter also shows how the controller reads the filter's coefficients. From
the beginning of the step to where the tool reverses it slides one way, so that dry friction is a constant force.
That force is unknown, and so is what friction held before; with each reading the step is computed, and the force
fitted that explains most of the rest. The reading fits that leaves the smallest rest, if clearly smaller than each
other one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Floats, floats
from profiles.axis.notch import SignConvention
from profiles.axis.sampled_loop import SampledLoop
from profiles.problem import refusal_error

SETTLED_FRACTION = 0.05  # of the step; a tool that stays within it has settled
RISE_FROM, RISE_TO = 0.1, 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFigures:
    """The answer to a step, times from its beginning in the reference.

    `rise_ms` is from 10 to 90 % of the step, `settling_ms` until the position stays within 5 % of it, `end_um`
    what is missing on the mean of the last fifth. With friction a tool may reach neither: then they are None.
    """

    size_um: float
    rise_ms: float | None
    overshoot_percent: float
    settling_ms: float | None
    end_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorFigures:
    """The following error along a path, um."""

    peak_um: float
    rms_um: float


def step_figures(time_s: Floats, reference: Floats, position: Floats, *, least_um: float) -> StepFigures:
    """Return the figures of one step; lengths in um, shapes (n,).

    `least_um` is the least band in which a tool counts as settled: what its encoder shows. Raises `ProfileError`:
    `health.no_step`, the reference makes none.
    """
    low, high = float(reference[0]), float(reference[-1])
    size = high - low
    part = (position - low) / size if size else np.zeros_like(position)
    if abs(size) <= least_um:
        raise refusal_error("health.no_step", value=f"{size:.3g} um")
    begins = int(np.argmax(np.abs(reference - low) > 0.001 * abs(size)))
    band = max(SETTLED_FRACTION, least_um / abs(size))
    outside = np.flatnonzero(np.abs(part - 1.0) > band)
    settled = int(outside[-1]) + 1 if outside.size else begins
    rises = float(part.max()) >= RISE_TO
    rise_s = _reaches(time_s, part, RISE_TO) - _reaches(time_s, part, RISE_FROM) if rises else None
    return StepFigures(
        size_um=size,
        rise_ms=None if rise_s is None else 1000.0 * rise_s,
        overshoot_percent=max(100.0 * (float(part.max()) - 1.0), 0.0),
        settling_ms=None if settled >= len(time_s) else 1000.0 * float(time_s[settled] - time_s[begins]),
        end_um=float(np.mean(high - position[-max(len(position) // 5, 1) :])),
    )


def error_figures(reference: Floats, position: Floats) -> ErrorFigures:
    """Return the largest and the rms following error; lengths in um."""
    left = reference - position
    return ErrorFigures(peak_um=float(np.abs(left).max()), rms_um=math.sqrt(float(np.mean(left**2))))


def model_step(loop: SampledLoop, reference: Floats) -> Floats:
    """Return the positions that a loop at rest at the first value makes of a reference, sample by sample."""
    from scipy.signal import lfilter

    numerator, denominator = loop.closed_polynomials(delayed=True)
    start = float(reference[0])
    return floats(start + lfilter(numerator, denominator, reference - start))


def _reaches(time_s: Floats, part: Floats, level: float) -> float:
    """Return when a fraction is first reached, between the samples."""
    place = int(np.argmax(part >= level))
    if place == 0:
        return float(time_s[0])
    before, after = float(part[place - 1]), float(part[place])
    return float(time_s[place - 1] + (level - before) / (after - before) * (time_s[place] - time_s[place - 1]))


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


def left_by(loop: SampledLoop, test: GatheredStep) -> Mapping[SignConvention, float]:
    """Return what each reading leaves of a step: rms over its size, with the force that leaves least."""
    return {reading: _step_residual(loop, test, reading) for reading in SignConvention}


def reading_of(left: Mapping[SignConvention, float]) -> SignConvention | None:
    """Return the reading that a test shows; None where two are too much alike."""
    first, second = sorted(left, key=lambda each: left[each])[:2]
    return first if left[second] >= CLEARLY * max(left[first], LEAST_LEFT) else None


def _step_residual(loop: SampledLoop, test: GatheredStep, reading: SignConvention) -> float:
    from scipy.signal import lfilter

    read = replace(loop, gains=replace(loop.gains, notch=loop.gains.notch.read_as(reading)))
    begin, end = _one_way(loop, test)
    with np.errstate(all="ignore"):
        off = (test.position_um - model_step(read, test.reference_um))[begin:end]
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
