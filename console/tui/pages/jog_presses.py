"""Presses of a jog key: one step each at rest, none for a held key; the others are counted."""

from __future__ import annotations

import math

REPEAT_S = 0.12
"""Presses of one key closer together are a terminal's repeats of a held key."""

FIRST_REPEAT_S = 0.7
"""Longest delay before a terminal repeats a held key, in most settings."""

SURE_S = 0.06
"""Decision time for a press that may be such a repeat: the next one follows some 30 ms after it."""

SERIES_S = 2.0
"""Presses further apart are counted anew."""


class JogPresses:
    """Presses of one jog key. `taken` are steps that were commanded, `missed` came during motion.

    `held`: the key repeats. Times are of any monotonic clock. No press is decided later than `SURE_S`
    after it: nothing waits for the end of a motion.
    """

    def __init__(self) -> None:
        self.taken = self.missed = 0
        self.held = False
        self._key: str | None = None
        self._pressed_s = -math.inf
        self._sure_at_s: float | None = None

    def forget(self) -> None:
        """Reset after another key or a stop: nothing waits, and the count begins anew."""
        self.taken = self.missed = 0
        self.held = False
        self._key, self._sure_at_s = None, None

    def press(self, key: str, now_s: float, *, at_rest: bool) -> bool:
        """Note a press; return whether it is a step now. For one that `waits`, `due` decides."""
        gap_s = now_s - self._pressed_s if key == self._key else math.inf
        if gap_s > SERIES_S:
            self.forget()
        self._key, self._pressed_s, self._sure_at_s = key, now_s, None
        self.held = gap_s < REPEAT_S
        if self.held:
            return False
        if gap_s < FIRST_REPEAT_S:
            self._sure_at_s = now_s + SURE_S
            return False
        return self._decided(at_rest=at_rest)

    @property
    def waits(self) -> bool:
        """Whether a press waits until it is known to be no repeat."""
        return self._sure_at_s is not None

    def due(self, now_s: float, *, at_rest: bool) -> str | None:
        """Return the key of a press that was no repeat, once, where it is a step."""
        if self._sure_at_s is None or now_s < self._sure_at_s:
            return None
        self._sure_at_s = None
        return self._key if self._decided(at_rest=at_rest) else None

    def _decided(self, *, at_rest: bool) -> bool:
        self.taken += at_rest
        self.missed += not at_rest
        return at_rest

    def refused(self) -> None:
        """Withdraw the last step: the machine was still busy."""
        self.taken -= 1
        self.missed += 1
