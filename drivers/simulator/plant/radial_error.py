"""Radial error motion of a spindle: the axis wanders as it turns, unseen by any encoder."""

from __future__ import annotations

import math
from random import Random

PLACES = 3600
"""Angular resolution of the error motion: 0.1 deg, whose error is below a hundredth of it."""

PIECES = (2, 3, 4, 5, 7)
"""Undulations per revolution of the synchronous part. One is no error: the part is off the axis, and round."""

STRAY_PER_TURN = (0.43, 2.57)
"""Undulations per revolution of the asynchronous part: the cage of a rolling bearing, and its rolling elements."""

STRAY_SHARE = 0.1
"""Asynchronous over synchronous part, peak to peak."""


class RadialError:
    """Harmonics of falling size and random phases, `um_pp` peak to peak over a turn; a few asynchronous."""

    def __init__(self, um_pp: float, random: Random) -> None:
        phases = [(n, random.uniform(0.0, 2.0 * math.pi)) for n in PIECES]
        turn = [2.0 * math.pi * place / PLACES for place in range(PLACES)]
        raw = [sum(math.cos(n * angle + phase) / n for n, phase in phases) for angle in turn]
        scale = um_pp / 1000.0 / (max(raw) - min(raw))
        self._repeats_mm = [scale * value for value in raw]
        self._stray_mm = 0.25 * STRAY_SHARE * um_pp / 1000.0
        self._strays = [(2.0 * math.pi * each, random.uniform(0.0, 2.0 * math.pi)) for each in STRAY_PER_TURN]

    def at_mm(self, turns: float) -> float:
        """Return the displacement of the work towards the tool, mm, at spindle position `turns` from its index."""
        strays = sum(math.sin(wave * turns + phase) for wave, phase in self._strays)
        return self._repeats_mm[int(turns % 1.0 * PLACES) % PLACES] + self._stray_mm * strays
