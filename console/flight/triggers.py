"""When a recording is frozen: some seconds after an alarm of high or medium priority, or a stop."""

from __future__ import annotations

from console.flight.frozen import Cause
from console.session.station.alarms import Priority
from console.session.station.state import StationState

AFTER_S = 5.0  # aftermath that is still recorded
JOINED_S = 60.0  # causes within this time of the first one make one file
QUIT = "quit"  # the stop with which a console leaves its machine


class Triggers:
    """Find causes in the states; it belongs to the thread of the recorder."""

    def __init__(self) -> None:
        self.leaving = False
        self.is_fresh = False
        """Whether a cause came that is not on the disk yet."""
        self.extends = False
        """Whether the last causes belong to the file that was frozen before."""
        self._alarms: frozenset[tuple[str, str]] = frozenset()
        self._stop_s: float | None = None
        self._causes: list[Cause] = []
        self._due_s: float | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether there is something to freeze."""
        return self._due_s is not None

    def seen(self, state: StationState, now_s: float) -> tuple[Cause, ...]:
        """Return the causes that are new in a state."""
        before = self._alarms
        urgent = [alarm for alarm in state.alarms if alarm.active and alarm.priority is not Priority.LOW]
        self._alarms = frozenset((alarm.problem.code, alarm.problem.key) for alarm in urgent)
        fresh = [each.problem.code for each in urgent if (each.problem.code, each.problem.key) not in before]
        stop = state.stop
        if stop is not None and stop.sent_s != self._stop_s and not (self.leaving and stop.reason == QUIT):
            fresh.insert(0, f"stop {stop.reason}")
        self._stop_s = None if stop is None else stop.sent_s
        causes = tuple(Cause(at_s=now_s, reason=reason) for reason in fresh)
        for cause in causes:
            self.add(cause)
        return causes

    def add(self, cause: Cause) -> None:
        """Take a cause: the file is due some seconds later; it is another one where the last began long ago."""
        if self._causes and cause.at_s - self._causes[0].at_s > JOINED_S and not self.is_waiting:
            self._causes = []
        self._causes.append(cause)
        self.is_fresh = True
        if self._due_s is None:
            self._due_s = cause.at_s + AFTER_S
            self.extends = len(self._causes) > 1

    def is_due(self, now_s: float) -> bool:
        """Whether the aftermath is over."""
        return self._due_s is not None and now_s >= self._due_s

    def again(self, due_s: float) -> None:
        """Freeze once more: it could not be written."""
        self._due_s = due_s

    def begun(self) -> tuple[Cause, ...]:
        """Return all causes of the file, which is frozen now."""
        self._due_s = None
        return tuple(self._causes)
