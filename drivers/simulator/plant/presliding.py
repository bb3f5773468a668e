"""Dry friction that builds up over a distance, as in rolling guides: before it slides, a slide is on a spring.

Dahl's law with exponent 1: with each displacement dx the friction F comes nearer to its limit F_c against the
motion, dF/dx = (F_c - F sign(dx)) / s, with s the presliding distance. It does not depend on the speed.
"""

from __future__ import annotations

import math

from drivers.simulator.plant.tip_load import TipLoad


class Presliding:
    """A load on the tool: the friction of its guides, and the force of the cut (`TipLoad`) where there is one.

    `limit` is the friction in sliding as a deceleration, counts/s2; `distance` is where 63 % of it are there,
    counts. Forces are positive with the direction of counting.
    """

    acts = True

    def __init__(self, limit: float, distance: float, cut: TipLoad | None) -> None:
        self._limit, self._distance, self._cut = limit, distance, cut
        self._cutting: TipLoad | None = None
        self._at: float | None = None
        self._drag = 0.0

    @property
    def led(self) -> bool:
        """Whether the force of the cut is found for each servo cycle."""
        return self._cut is not None and self._cut.led

    def begin(self) -> None:
        """Begin a block of servo cycles."""
        if self._cut is not None:
            self._cut.begin()
            self._cutting = self._cut if self._cut.acts else None

    def push(self, place: float) -> float:
        """Return the acceleration through the servo cycle that begins at this place, counts/s2.

        It is that of the middle of the cycle, as if the speed stayed: taken at its beginning the spring would
        lag by half a cycle, which is a damping below 0.
        """
        moved = 0.0 if self._at is None else place - self._at
        self._at = place
        self._drag = self._after(moved)
        pushed = self._after(0.5 * moved)
        return -pushed if self._cutting is None else self._cutting.push(place) - pushed

    def _after(self, moved: float) -> float:
        """Return the friction against the motion, positive with counting, after a displacement."""
        limit = math.copysign(self._limit, moved)
        return limit + (self._drag - limit) * math.exp(-abs(moved) / self._distance)
