"""The machine's time as the host sees it: a value that is read and waited for, real or simulated."""

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
    """Machine time is everybody's time."""

    def now_s(self) -> float:
        """Return the monotonic time."""
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)
