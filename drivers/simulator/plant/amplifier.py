"""A current that lags: the force of a motor comes up to what was asked for with a time constant."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.simulator.plant.driven_mass import DrivenMass


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentLag:
    """What is left in a servo cycle of a force that is not yet, or still, there; exact for a held command.

    The difference d of the force from what is asked dies out as d exp(-t / lag). At the end of the cycle `left` of
    it remains; `mean` is its mean over the cycle. Beside that mean, held, it moves the mass by another
    `more_x` d and its speed by `more_v` d, because more of it comes early (counts and counts/s, d in counts/s2).
    """

    left: float
    mean: float
    more_x: float
    more_v: float


def current_lag(mass: DrivenMass, cycle_s: float, lag_s: float) -> CurrentLag:
    """Return the lag of a first-order current loop with the time constant `lag_s`, above 0, through one cycle.

    With r = damping over mass: v = (exp(-T/lag) - exp(-r T)) / (r - 1/lag), x = (lag (1 - exp(-T/lag)) - v) / r.
    """
    left, rate = math.exp(-cycle_s / lag_s), mass.damping_per_s
    impulse_s = lag_s * (1.0 - left)
    if rate * cycle_s < 1e-6:  # the difference below would cancel
        v, x = impulse_s, lag_s * (cycle_s - impulse_s)
    else:
        v = (left - math.exp(-rate * cycle_s)) / (rate - 1.0 / lag_s)
        x = (impulse_s - v) / rate
    mean = impulse_s / cycle_s
    held = mass.held(cycle_s)
    per_unit = 1.0 / mass.acceleration_per_bit if mass.acceleration_per_bit else 0.0
    return CurrentLag(
        left=left,
        mean=mean,
        more_x=x - mean * held.push_x * per_unit,
        more_v=v - mean * held.push_v * per_unit,
    )
