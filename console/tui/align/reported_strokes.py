"""Strokes that a terminal reports as presses or repeats: which press is one of a finger that presses now."""

from __future__ import annotations

import math

from console.tui.align.jog_presses import REPEAT_S
from console.tui.application.key_releases import Stroke


class ReportedStrokes:
    """A press so close behind another stroke that no finger made both waited somewhere on the line."""

    def __init__(self) -> None:
        self._heard_s = -math.inf

    def is_finger(self, stroke: Stroke, now_s: float) -> bool:
        """Note a stroke of a jog key, at a time of any monotonic clock; return whether a finger presses now."""
        gap_s, self._heard_s = now_s - self._heard_s, now_s
        return not stroke.repeated and gap_s >= REPEAT_S
