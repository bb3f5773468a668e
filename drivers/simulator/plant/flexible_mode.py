"""A resonance of the tool axis that its scale sees: something between motor, scale and tip that bends.

q'' + 2 z w q' + w^2 q = c a, with a the acceleration that the current gives the rigid axis and c the fraction
of the mode. Scale and tip are at x + q. A constant force through a servo cycle moves it exactly.
"""

from __future__ import annotations

import math


class FlexibleMode:
    """One mode, in counts: its frequency in Hz, its damping ratio, and its fraction c of the acceleration.

    `bend` is q. Neither friction nor the force of the cut bends it.
    """

    def __init__(self, hz: float, damping_ratio: float, fraction: float, cycle_s: float) -> None:
        omega = 2.0 * math.pi * hz
        damped = omega * math.sqrt(1.0 - damping_ratio**2)
        fade, decay = math.exp(-damping_ratio * omega * cycle_s), damping_ratio * omega
        cosine, sine = fade * math.cos(damped * cycle_s), fade * math.sin(damped * cycle_s) / damped
        self._own = cosine + decay * sine, sine, -(omega**2) * sine, cosine - decay * sine
        self._static = fraction / omega**2
        self.bend = 0.0
        self._speed = 0.0

    def step(self, acceleration: float) -> None:
        """Advance one cycle under the acceleration of the rigid axis, counts/s2."""
        rest = self._static * acceleration
        off, speed = self.bend - rest, self._speed
        own = self._own
        self.bend = rest + own[0] * off + own[1] * speed
        self._speed = own[2] * off + own[3] * speed
