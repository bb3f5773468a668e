"""The notch filter of a servo loop: two zeros and two poles on the whole output of the controller.

N(z) / D(z) = (1 + n1/z + n2/z^2) / (1 + d1/z + d2/z^2)

So the maker's User Manual computes the coefficients ("Manual Notch Specification"), and changes the proportional
gain for what the filter does at rest, (1 + n1 + n2) / (1 + d1 + d2): nothing normalises it. No real controller was
measured with it yet, so each filter can be read with other signs, too (`SignConvention`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from profiles.arrays import Complexes, Floats, complexes, floats

RESOLUTION = 2.0**-10
"""Step of a proposed coefficient: exact in a fixed-point fraction of 24 bits, and in ten decimals of a reply."""

MOST = 2.0  # a coefficient is a fraction of 24 bits from -2 on, and below 2: a controller takes 2 for -2
LEAST_AT_REST = 0.05  # a filter with less gain at rest than this, or turned round, is no notch


def is_coefficient(value: float) -> bool:
    """Whether a controller takes a value as it is."""
    return -MOST <= value < MOST


class SignConvention(StrEnum):
    """How a controller may read the signs of the coefficients: as stated, or other than that."""

    STATED = "stated"
    NUMERATOR = "numerator"
    DENOMINATOR = "denominator"
    BOTH = "both"


OTHER_READINGS = tuple(each for each in SignConvention if each is not SignConvention.STATED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Notch:
    """One filter, by its coefficients; all 0 is none."""

    n1: float = 0.0
    n2: float = 0.0
    d1: float = 0.0
    d2: float = 0.0

    def __bool__(self) -> bool:
        """Whether there is a filter."""
        return any(self.coefficients)

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """The coefficients in the order of Ix36 to Ix39."""
        return self.n1, self.n2, self.d1, self.d2

    @property
    def numerator(self) -> Floats:
        """The numerator in falling powers of z."""
        return floats([1.0, self.n1, self.n2])

    @property
    def denominator(self) -> Floats:
        """The denominator in falling powers of z."""
        return floats([1.0, self.d1, self.d2])

    @property
    def at_rest(self) -> float:
        """The gain at 0 Hz; infinite where the filter integrates."""
        under = 1.0 + self.d1 + self.d2
        return (1.0 + self.n1 + self.n2) / under if under else math.inf

    @property
    def steady(self) -> bool:
        """Whether its poles are inside the unit circle, and its gain at rest is one that a loop can have."""
        inside = abs(self.d2) < 1.0 and abs(self.d1) < 1.0 + self.d2
        return inside and LEAST_AT_REST <= self.at_rest < math.inf

    def response_at(self, z: Complexes) -> Complexes:
        """Return the response."""
        return complexes(np.polyval(self.numerator, z) / np.polyval(self.denominator, z))

    def at_hz(self, hz: Floats, period_s: float) -> Complexes:
        """Return the response at frequencies, run once in each period."""
        return self.response_at(complexes(np.exp(2j * np.pi * hz * period_s)))

    def read_as(self, reading: SignConvention) -> Notch:
        """Return the filter that a controller makes of these coefficients by a reading."""
        found = self
        if reading in (SignConvention.NUMERATOR, SignConvention.BOTH):
            found = replace(found, n1=-self.n1, n2=-self.n2)
        if reading in (SignConvention.DENOMINATOR, SignConvention.BOTH):
            found = replace(found, d1=-self.d1, d2=-self.d2)
        return found

    def round_steps(self) -> Notch:
        """Return the filter in steps that a controller takes exactly."""
        n1, n2, d1, d2 = (round(each / RESOLUTION) * RESOLUTION for each in self.coefficients)
        return Notch(n1=n1, n2=n2, d1=d1, d2=d2)


NO_NOTCH = Notch()


def damped_pair(hz: float, ratio: float, period_s: float) -> tuple[float, float]:
    """Return the coefficients of two zeros, or poles, at a frequency with a damping ratio, sampled exactly."""
    turn = 2.0 * math.pi * hz * period_s
    if ratio < 1.0:
        fade = math.exp(-ratio * turn)
        return -2.0 * fade * math.cos(turn * math.sqrt(1.0 - ratio**2)), fade**2
    apart = math.sqrt(ratio**2 - 1.0)
    slow, fast = math.exp(-turn * (ratio - apart)), math.exp(-turn * (ratio + apart))
    return -(slow + fast), slow * fast


def placed_notch(zero_hz: float, zero_ratio: float, pole_hz: float, pole_ratio: float, period_s: float) -> Notch:
    """Return a filter by its zeros and its poles, rounded as a controller takes it."""
    n1, n2 = damped_pair(zero_hz, zero_ratio, period_s)
    d1, d2 = damped_pair(pole_hz, pole_ratio, period_s)
    return Notch(n1=n1, n2=n2, d1=d1, d2=d2).round_steps()
