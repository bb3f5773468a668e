"""A spindle that turns unevenly: what its belt, its gears or its load do within a turn, and no servo takes out."""

from __future__ import annotations

import math
from collections.abc import Iterable

FADES_IN_TURNS = 0.25
"""In how much of a turn the swing comes up or goes: the spindle must not jump, nor turn by itself."""

GONE_COUNTS = 1e-3


class Ripple:
    """Swings a track about its mean, `per_turn` times a turn of the iron, so that the speed swings by a share.

    With v the mean speed and k = 2 pi per_turn / turn, the angle is x + (share / k) sin(k x), and so the speed
    v (1 + share cos(k x)).
    """

    def __init__(self, counts_per_turn: float) -> None:
        self._counts_per_turn = counts_per_turn
        self._amplitude = 0.0
        self._last: float | None = None

    @property
    def swings(self) -> bool:
        """Whether something of the swing is there, wanted or not."""
        return self._amplitude != 0.0

    def swing(self, track: Iterable[float], origin: float, share: float, per_turn: int) -> list[float]:
        """Return a track (motor counts, its zero at `origin`) as the iron really goes."""
        wave = 2.0 * math.pi * per_turn / self._counts_per_turn
        wanted, fades = share / wave, FADES_IN_TURNS * self._counts_per_turn
        swung = []
        for mean in track:
            place = mean + origin
            if self._last is not None:
                self._amplitude += (wanted - self._amplitude) * min(abs(place - self._last) / fades, 1.0)
            self._last = place
            swung.append(mean + self._amplitude * math.sin(wave * place))
        if not share and abs(self._amplitude) < GONE_COUNTS:
            self._amplitude, self._last = 0.0, None
        return swung
