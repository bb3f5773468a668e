"""The scale of an axis: it counts, and what is between two counts nobody is told."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

read_encoder: Callable[[float], int] = round
"""The reading for a true position, both in counts: the nearest whole one. A name for what Python has built in,
because it stands in the innermost loop of all."""

DRAWN_AT_ONCE = 4096


class Scale:
    """A scale without noise. `now` and `before` are the noise of its last two readings, in counts."""

    now = before = 0.0
    read = staticmethod(read_encoder)


class NoisyScale(Scale):
    """A scale whose every reading has a Gaussian noise of its own before it is rounded."""

    def __init__(self, rms_counts: float, seed: int) -> None:
        self._rms_counts = rms_counts
        self._generator = np.random.default_rng(seed)
        self._drawn: list[float] = []

    def read(self, place: float) -> int:
        """Return the reading at a true place, counts."""
        if not self._drawn:
            self._drawn = self._generator.normal(0.0, self._rms_counts, DRAWN_AT_ONCE).tolist()
        self.before, self.now = self.now, self._drawn.pop()
        return round(place + self.now)
