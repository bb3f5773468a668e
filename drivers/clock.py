"""Machine time as the host sees it, real or simulated: it can be read and waited for."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds of machine time."""

    def now_s(self) -> float:
        """Return the time since some fixed start."""

    def wait(self, seconds: float) -> None:
        """Let `seconds` of machine time pass."""


class RealClock:
    """Machine time that is wall-clock time."""

    def now_s(self) -> float:
        """Return the monotonic time."""
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)
