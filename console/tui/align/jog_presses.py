"""Presses of one jog key: which are presses of a finger, and which are a terminal's repeats of a held key.

A terminal may report them itself: which press is one of a finger then.
"""

from __future__ import annotations

import math

from console.tui.application.key_releases import Stroke

REPEAT_S = 0.12  # presses of one key closer together are a terminal's repeats of a held key
SURE_S = REPEAT_S  # decision time for a press that may be such a repeat: the next one follows within it


class JogPresses:
    """Presses of one jog key. `held`: the key repeats.

    Times are of any monotonic clock. No press is decided later than `SURE_S` after it.
    """

    def __init__(self) -> None:
        self.held = False
        self._key: str | None = None
        self._pressed_s = -math.inf
        self._sure_at_s: float | None = None

    def forget(self) -> None:
        """Reset after another key or a stop: no press waits for its decision."""
        self.held = False
        self._key, self._sure_at_s = None, None

    def press(self, key: str, now_s: float) -> bool:
        """Note a press; return whether a finger made it. For one that `waits`, `take_due_key` decides."""
        gap_s = now_s - self._pressed_s if key == self._key else math.inf
        self._key, self._pressed_s, self._sure_at_s = key, now_s, None
        self.held = gap_s < REPEAT_S
        if self.held:
            return False
        if math.isfinite(gap_s):
            # However long ago the one before was: a line that stood still brings all repeats at once.
            self._sure_at_s = now_s + SURE_S
            return False
        return True

    @property
    def waits(self) -> bool:
        """Whether a press waits until it is known to be no repeat."""
        return self._sure_at_s is not None

    def take_due_key(self, now_s: float) -> str | None:
        """Return the key of a press that was no repeat, once."""
        if self._sure_at_s is None or now_s < self._sure_at_s:
            return None
        self._sure_at_s = None
        return self._key


class ReportedStrokes:
    """A press so close behind another stroke that no finger made both waited somewhere on the line."""

    def __init__(self) -> None:
        self._heard_s = -math.inf

    def is_finger(self, stroke: Stroke, now_s: float) -> bool:
        """Note a stroke of a jog key, at a time of any monotonic clock; return whether a finger presses now."""
        gap_s, self._heard_s = now_s - self._heard_s, now_s
        return not stroke.repeated and gap_s >= REPEAT_S
