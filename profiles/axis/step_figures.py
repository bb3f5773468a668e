"""Figures of a servo from samples of its reference and its position: the step, and the error along a path."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from profiles.arrays import Floats, floats
from profiles.axis.sampled_loop import SampledLoop
from profiles.problem import refused

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
        raise refused("health.no_step", value=f"{size:.3g} um")
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


def modelled(loop: SampledLoop, reference: Floats) -> Floats:
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
