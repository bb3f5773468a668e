"""The axis of a spindle wanders as it turns: the work comes towards the tool and goes, and no encoder sees it."""

from __future__ import annotations

import math
from random import Random

PLACES = 3600
"""Places of a turn between which the wander is not resolved: 0.1 deg, below a hundredth of it."""

PIECES = (2, 3, 4, 5, 7)
"""Waves a turn of what repeats. Once a turn is no error: the part sits a little beside the axis, and is round."""

STRAY_PER_TURN = (0.43, 2.57)
"""Waves a turn of what does not repeat: the cage of a rolling bearing, and what its rolling elements do."""

STRAY_SHARE = 0.1
"""What does not repeat over what does, peak to peak."""


class RadialError:
    """Waves of falling size and of phases by chance, `um_pp` peak to peak over a turn; a little beside strays."""

    def __init__(self, um_pp: float, random: Random) -> None:
        phases = [(n, random.uniform(0.0, 2.0 * math.pi)) for n in PIECES]
        turn = [2.0 * math.pi * place / PLACES for place in range(PLACES)]
        raw = [sum(math.cos(n * angle + phase) / n for n, phase in phases) for angle in turn]
        scale = um_pp / 1000.0 / (max(raw) - min(raw))
        self._repeats_mm = [scale * value for value in raw]
        self._stray_mm = 0.25 * STRAY_SHARE * um_pp / 1000.0
        self._strays = [(2.0 * math.pi * each, random.uniform(0.0, 2.0 * math.pi)) for each in STRAY_PER_TURN]

    def at_mm(self, turns: float) -> float:
        """Return how far the work is towards the tool, mm, when the spindle stands `turns` from its index."""
        strays = sum(math.sin(wave * turns + phase) for wave, phase in self._strays)
        return self._repeats_mm[int(turns % 1.0 * PLACES) % PLACES] + self._stray_mm * strays
