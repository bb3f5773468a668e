"""Statistics of parts in a row: run chart limits, capability with its confidence, trend.

Sources: NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2 (individuals chart) and 6.1.6 (capability; the
interval of Cp by chi-square, that of a two-sided Cpk by Bissell's approximation). For one limit the interval is
exact, by the noncentral t distribution (Owen 1968, as for one-sided tolerance limits). The indices suppose
normally distributed parts in a stable process: look at the chart first. Roundness cannot be below 0 and is skewed
to the right, so that its index flatters a process near its limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats
from profiles.least_squares import CONFIDENCE, student

D2 = 1.128
"""Mean range of two normal values, in standard deviations."""

LEAST_PARTS = 30
"""Fewest parts for a capability: with 30 the 95 % interval of Cp is still from 0.74 to 1.26 of its value."""

LEAST_CHART = 8
"""Fewest parts for run chart limits: fewer moving ranges say too little of the scatter."""

LEAST_TREND = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class RunChart:
    """Individuals chart of M values: mean +- 2.66 (3 / 1.128) mean moving ranges. `beyond` are places outside."""

    mean: float
    lower: float
    upper: float
    moving_range: float
    beyond: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Capability:
    """Capability of M `parts`, with the overall standard deviation; intervals have the stated confidence.

    `cp` and its interval are None with one limit.
    """

    parts: int
    mean: float
    sd: float
    cpk: float
    cpk_low: float
    cpk_high: float
    cp: float | None = None
    cp_low: float | None = None
    cp_high: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Trend:
    """Slope per part of a least squares line, and the half width of its interval."""

    per_part: float
    half_width: float
    parts: int

    @property
    def significant(self) -> bool:
        """Whether the slope differs from 0 by more than its interval."""
        return abs(self.per_part) > self.half_width


def run_chart(values: ArrayLike) -> RunChart | None:
    """Return the chart of values in the order of manufacture, shape (M,); None below `LEAST_CHART`."""
    found = _check_values(values)
    if found.size < LEAST_CHART:
        return None
    mean, moving = float(found.mean()), float(np.abs(np.diff(found)).mean())
    reach = 3.0 * moving / D2
    beyond = tuple(int(place) for place in np.flatnonzero(np.abs(found - mean) > reach))
    return RunChart(mean=mean, lower=mean - reach, upper=mean + reach, moving_range=moving, beyond=beyond)


def capability_below(values: ArrayLike, upper: float, confidence: float = CONFIDENCE) -> Capability | None:
    """Return the capability against an upper limit alone, such as that of roundness.

    None below `LEAST_PARTS` or where all values are the same: nothing is claimed then.
    """
    found = _enough(values)
    if found is None:
        return None
    mean, sd = float(found.mean()), float(found.std(ddof=1))
    cpk = (upper - mean) / (3.0 * sd)
    low, high = _one_sided(cpk, found.size, confidence)
    return Capability(parts=found.size, mean=mean, sd=sd, cpk=cpk, cpk_low=low, cpk_high=high)


def capability_within(values: ArrayLike, lower: float, upper: float) -> Capability | None:
    """Return the capability between two limits, such as those of a diameter; None as `capability_below`."""
    from scipy.stats import chi2

    found = _enough(values)
    if found is None:
        return None
    count, mean, sd = found.size, float(found.mean()), float(found.std(ddof=1))
    cp, cpk = (upper - lower) / (6.0 * sd), min(upper - mean, mean - lower) / (3.0 * sd)
    tail, free = 0.5 * (1.0 - CONFIDENCE), count - 1
    half = student(math.inf) * math.sqrt(1.0 / (9.0 * count) + cpk**2 / (2.0 * free))
    return Capability(
        parts=count,
        mean=mean,
        sd=sd,
        cpk=cpk,
        cpk_low=cpk - half,
        cpk_high=cpk + half,
        cp=cp,
        cp_low=cp * math.sqrt(float(chi2.ppf(tail, free)) / free),
        cp_high=cp * math.sqrt(float(chi2.ppf(1.0 - tail, free)) / free),
    )


def trend(values: ArrayLike) -> Trend | None:
    """Return the trend of values in the order of manufacture, shape (M,); None below `LEAST_TREND`."""
    found = _check_values(values)
    if found.size < LEAST_TREND:
        return None
    place = np.arange(found.size) - 0.5 * (found.size - 1)
    spread = float(place @ place)
    slope = float(place @ found) / spread
    residual = found - found.mean() - slope * place
    sd = math.sqrt(float(residual @ residual) / (found.size - 2) / spread)
    return Trend(per_part=slope, half_width=student(found.size - 2) * sd, parts=found.size)


def _one_sided(cpk: float, count: int, confidence: float) -> tuple[float, float]:
    """Return the exact interval of an index with one limit: 3 sqrt(n) Cpk is noncentral t about its true value."""
    from scipy.optimize import brentq
    from scipy.stats import nct

    if cpk < 0.0:  # the distribution of scipy fails there; the mirrored one is the same
        low, high = _one_sided(-cpk, count, confidence)
        return -high, -low
    root, free, tail = math.sqrt(count), count - 1, 0.5 * (1.0 - confidence)
    measured = 3.0 * root * cpk
    # Some ten standard errors either way; the distribution function falls as the centre moves up.
    reach = 10.0 * math.sqrt(1.0 + measured**2 / (2.0 * free))

    def centre(probability: float) -> float:
        def off(at: float) -> float:
            return float(nct.cdf(measured, free, at)) - probability

        return float(brentq(off, measured - reach, measured + reach, xtol=1e-9))

    return centre(1.0 - tail) / (3.0 * root), centre(tail) / (3.0 * root)


def _enough(values: ArrayLike) -> Floats | None:
    found = _check_values(values)
    return found if found.size >= LEAST_PARTS and np.ptp(found) > 0.0 else None


def _check_values(values: ArrayLike) -> Floats:
    found = np.asarray(values, dtype=np.float64)
    if found.ndim != 1 or not np.isfinite(found).all():
        raise ValueError(f"finite values of shape (M,) are needed, not {found.shape}")
    return found
