"""The control of a machine that keeps the log of the session: a command is noted after it was passed on."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

from console.session.passing_control import PassingControl, record
from console.session.station.history.alarm_history import Instant
from console.session.station.history.session_log import LogEntry, SessionLog, command_entry, with_state
from console.session.station.state import StationState
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.session.station.commands import Command, Control


class LoggedControl(PassingControl):
    """Passes everything on at once. Stops are logged from the state, which also has those without a key."""

    def __init__(
        self,
        control: Control,
        local_time: Callable[[], datetime],
        noted: Callable[[Sequence[LogEntry]], None] = lambda entries: None,
    ) -> None:
        """Pass each new entry of a state on to `noted`, too."""
        super().__init__(control)
        self._noted = noted
        self.log = SessionLog()
        self._local_time = local_time
        self._posted: deque[LogEntry] = deque()

    def post(self, intent: Command) -> bool:
        """Post a command; note it afterwards."""
        taken = super().post(intent)
        if not intent.logged:
            return taken
        given: dict[str, Any] = {}
        if hasattr(intent, "axis") and hasattr(intent, "distance"):
            given = {"axis": intent.axis.value, "distance": intent.distance}
        self._posted.append(command_entry(type(intent).__name__, taken=taken, at=self._local_time(), **given))
        return taken

    def note(self, entry: LogEntry) -> None:
        """Add an entry that is no command of the operator."""
        self._posted.append(entry)

    def follow_state(self, state: StationState, said: tuple[Problem, ...], *, typed: bool) -> SessionLog:
        """Return the log up to this state and answer (`with_state`)."""
        if self._posted:
            waiting = [self._posted.popleft() for _ in range(len(self._posted))]
            self.log = self.log.with_entries(*waiting)
        now = Instant(now_s=self.now_s(), clock=self._local_time())
        before = self.log
        self.log = with_state(before, state, said, now, typed=typed)
        if self.log is not before and (fresh := self.log.count - before.count):
            record((self._noted,), self.log.entries[-fresh:])
        return self.log
