"""Speed ripple of a spindle: the effect of belt, gears or load within a turn, which no servo removes."""

from __future__ import annotations

import math
from collections.abc import Iterable

FADES_IN_TURNS = 0.25
"""Fraction of a turn over which the ripple fades in or out: the spindle must not jump, nor turn by itself."""

FADES_IN_S = 0.1
"""Time constant with which it fades while the spindle stands."""

NONE_BELOW_RPM, FULL_FROM_RPM = 3.0, 20.0
"""Mean speeds between which the ripple fades in: a standing spindle has no speed to oscillate."""

SMOOTHED_S = 0.02
"""Time constant of the mean speed: servo motion at rest is not speed."""

GONE_COUNTS = 1e-3


class Ripple:
    """Modulates a track about its mean, `per_turn` times a turn of the axis, with a fraction of its speed.

    With v the mean speed, k = 2 pi per_turn / turn and a phase p, the angle is x + (share / k) sin(k x + p), and
    so the speed v (1 + share cos(k x + p)).
    """

    def __init__(self, counts_per_turn: float, cycle_s: float, phase_rad: float = 0.0) -> None:
        self._counts_per_turn = counts_per_turn
        self._counts_per_s_at_1_rpm = counts_per_turn / 60.0
        self._cycle_s = cycle_s
        self._phase_rad = phase_rad
        self._amplitude = 0.0
        self._speed = 0.0  # counts/s
        self._per_turn = 0
        self._last: float | None = None

    @property
    def swings(self) -> bool:
        """Whether there is some ripple, commanded or still fading."""
        return self._amplitude != 0.0

    def swing(
        self, track: Iterable[float], origin: float, share: float, per_turn: int, *, jammed: bool = False
    ) -> list[float]:
        """Return a track (motor counts, its zero at `origin`) with the ripple; a jammed axis stays."""
        if not self.swings:
            self._per_turn = per_turn
        wave = 2.0 * math.pi * self._per_turn / self._counts_per_turn
        # Another number of cycles per turn starts when this one has faded out.
        target = share / wave if self._per_turn == per_turn else 0.0
        swung = []
        for mean in track:
            place = mean + origin
            if self._last is not None and not jammed:
                self._fade(target, place - self._last)
            self._last = place
            swung.append(mean + self._amplitude * math.sin(wave * place + self._phase_rad))
        if not (share or self.swings):
            self._last, self._speed = None, 0.0
        return swung

    def _fade(self, target: float, step: float) -> None:
        """Fade the amplitude for a cycle in which the mean position has moved a step."""
        self._speed += (step / self._cycle_s - self._speed) * self._cycle_s / SMOOTHED_S
        rpm = abs(self._speed) / self._counts_per_s_at_1_rpm
        target *= min(max((rpm - NONE_BELOW_RPM) / (FULL_FROM_RPM - NONE_BELOW_RPM), 0.0), 1.0)
        share = abs(self._speed) * self._cycle_s / (FADES_IN_TURNS * self._counts_per_turn)
        if target < self._amplitude:
            share = max(share, self._cycle_s / FADES_IN_S)
        self._amplitude += (target - self._amplitude) * min(share, 1.0)
        if not target and self._amplitude < GONE_COUNTS:
            self._amplitude = 0.0
