"""The bell of the terminal: once for a new alarm of high priority, and never for an answer to a key."""

from __future__ import annotations

from console.session.station.alarms import Alarms, Priority, unacknowledged_alarms

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
