"""Hold-to-run by the measured repeat of a terminal: while a jog key repeats, one finite step follows the other.

A terminal that reports no key release repeats a held key; how fast was measured while the operator held one
(`Repeat`). No step is commanded when no repeat came within the timeout, and once that has happened the key has to
be pressed anew: what a stalled line brings later moves nothing. One step is under way at most and none waits, so
that doing nothing stops the machine. Times are of any monotonic clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

CALIBRATION_S = 3.0
LEAST_REPEATS = 12  # in the calibration: slower than some five a second is no hold-to-run
FLOOR_S = 0.1  # shortest timeout, however fast a terminal repeats
MOST_GAP_S = 0.12  # a terminal, or a line, that repeats slower or with larger gaps is not used
MOST_FIRST_S = 0.7
LONGEST_STEP_S = 0.6
"""Longest step that may follow another by itself; longer ones are single presses."""

RELEASE_S = 0.25
"""From the release to the end of commanding, besides the timeout: hold-back of a key, tick of the screen, link."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeat:
    """Measured repeat of a held key: the delay before the first one, and the largest gap after it, s."""

    first_s: float
    gap_s: float

    @property
    def timeout_s(self) -> float:
        """Longest time without a repeat while the key is held."""
        return max(1.5 * self.gap_s, FLOOR_S)

    def overrun_steps(self, step_s: float) -> int:
        """Return how many steps may be made after the release: the one under way, and those begun till then."""
        return 2 + math.floor((self.timeout_s + RELEASE_S) / step_s)


class Calibration:
    """A key that is held for `CALIBRATION_S`; `measured` is None until then, and where it did not repeat well."""

    def __init__(self) -> None:
        self.measured: Repeat | None = None
        self._times: list[float] = []
        self._over = False

    def press(self, now_s: float) -> bool:
        """Note the key; return whether the calibration is over, as long as the key is held on."""
        if not self._times or now_s - self._times[-1] > MOST_FIRST_S + FLOOR_S:
            self._times, self._over, self.measured = [], False, None
        self._times.append(now_s)
        if not self._over and now_s - self._times[0] >= CALIBRATION_S:
            first, *rest = (after - before for before, after in zip(self._times, self._times[1:], strict=False))
            good = len(rest) >= LEAST_REPEATS and max(rest) <= MOST_GAP_S and first <= MOST_FIRST_S
            self.measured = Repeat(first_s=first, gap_s=max(rest)) if good else None
            self._over = True
        return self._over


class HoldRun:
    """One held jog key. It runs from its second repeat on, until one is late; then a new press begins again."""

    def __init__(self) -> None:
        self._pressed_s = self._repeated_s = -math.inf
        self._begun = False

    def begin(self, now_s: float) -> None:
        """Note a press of a finger: it may be held from now on."""
        self._pressed_s, self._repeated_s, self._begun = now_s, -math.inf, True

    def end(self) -> None:
        """Run no more before the next press."""
        self._begun = False

    def repeat(self, now_s: float, repeat: Repeat) -> None:
        """Note a repeat; one that is late ends the run."""
        if math.isinf(self._repeated_s):
            latest_s = self._pressed_s + 1.5 * repeat.first_s + repeat.timeout_s
        else:
            latest_s = self._repeated_s + repeat.timeout_s
        if now_s > latest_s:
            self.end()
        self._repeated_s = now_s

    def runs(self, now_s: float, repeat: Repeat | None) -> bool:
        """Whether the key is held, as far as can be known; False, once it was not."""
        if repeat is None or not self._begun or math.isinf(self._repeated_s):
            return False
        if now_s - self._repeated_s > repeat.timeout_s:
            self.end()
        return self._begun
