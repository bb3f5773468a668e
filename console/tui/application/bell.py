"""What is new since the last tick: whether the bell of the terminal rings, and in calm mode the screen is drawn.

The bell rings once for a new alarm of high priority, and never for an answer to a key. In calm mode the screen is
drawn once a second while nothing happens that somebody has to see at once.
"""

from __future__ import annotations

from collections.abc import Hashable

from console.session.station.alarms import Alarms, Priority, unacknowledged_alarms
from console.session.station.state import StationState

APART_S = 5.0  # a flood rings no more often
Rung = frozenset[tuple[str, str, int]]


class Bell:
    """What was rung for, and when. An alarm that is raised again, after it ended or not, is new again."""

    def __init__(self) -> None:
        self._known: Rung = frozenset()
        self._rung_s = float("-inf")

    def rings(self, alarms: Alarms, now_s: float) -> bool:
        """Whether to ring now; `now_s` is of any monotonic clock."""
        high = (alarm for alarm in unacknowledged_alarms(alarms) if alarm.priority is Priority.HIGH)
        before = self._known
        self._known = frozenset((alarm.problem.code, alarm.problem.key, alarm.count) for alarm in high)
        if not self._known - before or 0.0 <= now_s - self._rung_s < APART_S:
            return False
        self._rung_s = now_s
        return True


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
