"""The iron of the axes: a linear motor that is pushed, and an ideal follower. Positions are motor counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroOrderHold:
    """One servo cycle of a mass under a force that is held through it, exact.

    With x in counts, v in counts/s and the force in DAC bits, at the end of the cycle
    x' = x + glide v + push_x force and v' = decay v + push_v force.
    """

    decay: float
    glide: float
    push_x: float
    push_v: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearMotor:
    """A moving mass with viscous damping behind a current amplifier, as in Eq 9 and Table 4 of the paper."""

    mass_kg: float
    damping_n_s_per_m: float
    force_n_per_bit: float
    peak_output_bits: float
    counts_per_m: float

    def held(self, cycle_s: float) -> ZeroOrderHold:
        """Return what a servo cycle of `cycle_s` does to it."""
        rate = self.damping_n_s_per_m / self.mass_kg
        decay = math.exp(-rate * cycle_s)
        glide = (1.0 - decay) / rate
        speed_per_bit = self.force_n_per_bit / self.damping_n_s_per_m * self.counts_per_m
        return ZeroOrderHold(
            decay=decay,
            glide=glide,
            push_x=(cycle_s - glide) * speed_per_bit,
            push_v=(1.0 - decay) * speed_per_bit,
        )


OPEN_LOOP_COUNTS_PER_S = 100_000.0
"""Speed that a full open-loop output drives an ideal axis to, in the time constant with which it runs out."""

BARE_COAST_S = 0.1
"""How an axis runs out that has no machine behind it, time constant."""

BARE_ORIGIN = 500.0
"""Where such an axis stands at power-up, in counts from a home trigger."""


class IdealAxis:
    """An axis that is where it is told to be; switched off, it runs out with a time constant."""

    def __init__(self, cycle_s: float, coast_s: float, origin: float = 0.0) -> None:
        self.origin = origin
        self._x = 0.0
        self._step = 0.0
        self._keep = math.exp(-cycle_s / coast_s)
        self._full_step = OPEN_LOOP_COUNTS_PER_S * cycle_s

    def close_loop(self) -> float:
        """Stand still where it is."""
        self._step = 0.0
        return self._x

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`."""
        self.origin += counts
        self._x -= counts

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Be where the commands say."""
        positions = list(commands)
        if positions:
            before = positions[-2] if len(positions) > 1 else self._x
            self._x, self._step = positions[-1], positions[-1] - before
        return positions

    def push(self, output: float, cycles: int) -> list[float]:
        """Approach the speed of an open-loop output."""
        positions = []
        gained = (1.0 - self._keep) * self._full_step * output
        for _ in range(cycles):
            self._step = self._keep * self._step + gained
            self._x += self._step
            positions.append(self._x)
        return positions

    def coast(self, cycles: int) -> list[float]:
        """Run out."""
        return self.push(0.0, cycles)


def bare_axis(cycle_s: float) -> IdealAxis:
    """Return an axis with nothing behind it, for a motor that the machine does not use."""
    return IdealAxis(cycle_s, BARE_COAST_S, origin=BARE_ORIGIN)
