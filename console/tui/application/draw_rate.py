"""Calm mode: how often the screen is drawn while nothing happens that somebody has to see at once."""

from __future__ import annotations

from collections.abc import Hashable

from console.session.station.state import StationState

CALM_S = 1.0  # time between two drawings of live values in calm mode; otherwise each tick draws


class LastDrawing:
    """What was drawn last, and when. Identity tells what is new: states are immutable, and share what stays."""

    def __init__(self) -> None:
        self._drawn_s = float("-inf")
        self._news: tuple[object, ...] = ()

    def is_due(self, state: StationState, now_s: float, shown: tuple[Hashable, ...]) -> bool:
        """Whether to draw now: once a second, and when an alarm, an answer, a stop or the activity is new."""
        unknown, pace = state.snapshot is None, (state.speed, state.stop_waits)
        news = (state.activity, state.stop, state.alarms, state.refusals, state.armed, unknown, pace)
        before, self._news = self._news, (*news, *shown)
        alike = len(before) == len(self._news) and all(
            old is new or old == new for old, new in zip(before, self._news, strict=True)
        )
        if alike and 0.0 <= now_s - self._drawn_s < CALM_S:
            return False
        self._drawn_s = now_s
        return True
