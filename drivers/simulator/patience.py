"""Time for the one host of a simulator that shares its processor: it does not run away from a host that gets none.

A screen and its simulator are on one computer. Where that has too much to do, the screen is held up, and a real
card would end what moves, as it must. Here the card waits, for a while: longer silences are real ones.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.simulator.real_time import Advanced

HEARD_S = 0.18
"""How far time runs on without a word of the host: a lease that it has just renewed holds beyond that."""

PATIENCE_S = 2.0
"""How long a silence is put down to the computer."""


class PatientTime:
    """Advances a lathe unless its host is being waited for. `heard_s` says when it was last heard, None: never."""

    def __init__(self, lathe: Advanced, heard_s: Callable[[], float | None], now_s: Callable[[], float]) -> None:
        self._lathe, self._heard_s, self._now_s = lathe, heard_s, now_s

    def wait(self, seconds: float) -> None:
        """Advance it, or let the time pass it by."""
        heard_s = self._heard_s()
        if heard_s is None or not HEARD_S < self._now_s() - heard_s < PATIENCE_S:
            self._lathe.wait(seconds)
