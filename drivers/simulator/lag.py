"""How late a clock is served: the last delays, for the one in a hundred that is worst."""

from __future__ import annotations

import math
from collections import deque

KEPT = 20_000
"""Delays that are kept, the latest: at 5 ms a tick, those of 100 s."""


class LagRecord:
    """Delays in s. It never grows beyond `KEPT`."""

    def __init__(self) -> None:
        self._delays_s: deque[float] = deque(maxlen=KEPT)

    def __len__(self) -> int:
        return len(self._delays_s)

    def add(self, delay_s: float) -> None:
        """Take down one more delay."""
        self._delays_s.append(delay_s)

    def quantile_s(self, share: float) -> float:
        """Return the least delay that `share` (0 to 1) of the delays do not exceed.

        Raises:
            ValueError: nothing has been taken down.
        """
        if not self._delays_s:
            raise ValueError("no delays")
        ordered = sorted(self._delays_s)
        return ordered[max(math.ceil(share * len(ordered)), 1) - 1]
