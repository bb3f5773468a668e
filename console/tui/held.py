"""Keys that are held down: a terminal repeats them, and what they order must be done once."""

from __future__ import annotations

import math

from console.tui.keymap import Action

REPEAT_S = 0.8
"""Presses of one key that come sooner than this are the terminal's repeats of a key that is held."""


class HeldKeys:
    """Remembers when each action was last asked for."""

    def __init__(self) -> None:
        self._pressed_s: dict[str, float] = {}

    def repeats(self, action: Action, now_s: float) -> bool:
        """Take note of a press, and return whether it is the repeat of one that is to be done once."""
        before_s = self._pressed_s.get(action.id, -math.inf)
        self._pressed_s[action.id] = now_s
        return action.once and now_s - before_s < REPEAT_S
