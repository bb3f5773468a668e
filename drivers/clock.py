"""Machine time as the host sees it, real or simulated: it can be read and waited for."""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Callable
from typing import Protocol

OLD_S = 0.9
"""Age beyond which what an operator has typed starts nothing."""

FROZEN_S = 2.0
"""Pause of a program that was not just busy: what was typed before its end starts nothing, nothing stays armed."""


def boot_s() -> float:
    """Return the time since the computer was started, also while it was suspended, in which no program runs."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class FreezeWatch:
    """Notices when this process did not run for long: it was stopped, or its computer was suspended.

    `froze_s` is how long, 0.0 if it did not since `forget`. A thread looks, and so does whoever asks: right after
    a pause it is not known which thread runs first.
    """

    LOOK_S = 0.2

    def __init__(self) -> None:
        self._lock, self._froze_s, self._ran_s = threading.Lock(), 0.0, boot_s()
        self._last = float("-inf"), 0.0
        threading.Thread(target=_watch, args=(weakref.ref(self),), name="freezes", daemon=True).start()

    @property
    def froze_s(self) -> float:
        """How long this process did not run, s."""
        with self._lock:
            now_s = boot_s()
            if now_s - self._ran_s > FROZEN_S:
                self._froze_s = now_s - self._ran_s
                self._last = now_s, self._froze_s
            self._ran_s = now_s
            return self._froze_s

    def woke_from_s(self, within_s: float) -> float:
        """Return how long a pause was that ended within this time; 0.0 without one."""
        _ = self.froze_s
        woke_s, froze_s = self._last
        return froze_s if boot_s() - woke_s < within_s else 0.0

    def forget(self) -> None:
        """Let what begins now not be judged by what was before."""
        if self.froze_s:
            self._froze_s = 0.0


def _watch(watched: weakref.ref[FreezeWatch]) -> None:
    while (freezes := watched()) is not None:
        _ = freezes.froze_s
        del freezes
        time.sleep(FreezeWatch.LOOK_S)


class Clock(Protocol):
    """Seconds of machine time."""

    def now_s(self) -> float:
        """Return the time since some fixed start."""

    def wait(self, seconds: float) -> None:
        """Let `seconds` of machine time pass."""


class TrainingClock:
    """Machine time of a simulated lathe that runs `speed` times as fast as real time, or is paused (0).

    It never goes back. `leave` may be called from a signal handler: the time of who leaves is real time.
    """

    def __init__(
        self, real_s: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self.real_s, self._sleep = real_s, sleep
        began_s = real_s()
        self._since = began_s, began_s, 1.0  # machine time, real time and speed since then: replaced in one go
        self.leaving = self.asked_on = False

    @property
    def speed(self) -> float:
        """How many times as fast as real time it runs."""
        return self._since[2]

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self.speed == 0.0

    def set_speed(self, speed: float) -> None:
        """Run this many times as fast from now on."""
        self._since = self.now_s(), self.real_s(), speed
        self.asked_on = False

    def now_s(self) -> float:
        """Return the machine time."""
        at_s, real_s, speed = self._since
        return at_s + (self.real_s() - real_s) * speed

    def wait(self, seconds: float) -> None:
        """Sleep as long as that takes; while it is paused, as in real time."""
        self._sleep(seconds / (self.speed or 1.0))

    def ask_on(self) -> None:
        """Ask that a pause ends; whoever has paused the lathe does it."""
        self.asked_on = True

    def leave(self) -> None:
        """Ask that a pause ends, and that there is no further one."""
        self.leaving = True


class RealClock:
    """Machine time that is wall-clock time."""

    def now_s(self) -> float:
        """Return the monotonic time."""
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        """Sleep."""
        time.sleep(seconds)
