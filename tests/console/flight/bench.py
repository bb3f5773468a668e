"""A flight recorder with a clock of its own, turned by hand; and recordings made by it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from console.flight.frozen_recordings import frozen_in
from console.flight.notes import Inbox
from console.flight.recorded_forms import RecordedMoment, work_of
from console.flight.recorder import FlightRecorder
from console.flight.recording import Recording, read_recording
from console.session.station.alarms import Priority, raise_alarm
from console.session.station.state import Activity, StationState, StopState
from console.session.work import Work
from profiles.problem import Problem
from tests.tui.scenes import machine
from tests.tui.stage import lathe

BEGAN_S = 1000.0
ALARM = Problem(code="cut.spindle_stands")


class FlightBench:
    """What a console has of the recorder. The machine is at rest, and polled at each turn."""

    def __init__(self, data: Path, state: StationState | None = None, work: Work | None = None) -> None:
        self.data, self.now_s = data, BEGAN_S
        self.state, self.work, self.page = state or machine(Activity.READY), work, "jobs"
        self.inbox = Inbox(lambda: self.now_s)
        self.recorder = FlightRecorder(data, lathe(), self.observed, self.inbox, now_s=lambda: self.now_s)

    def observed(self) -> RecordedMoment:
        return RecordedMoment(state=self.state, page=self.page, work=work_of(self.work))

    def runs(self, seconds: float, each: Callable[[], object] = lambda: None) -> None:
        """Let time pass, with a poll and a turn of the recorder each 0.1 s."""
        for _ in range(round(10.0 * seconds)):
            self.now_s += 0.1
            snapshot = self.state.snapshot
            assert snapshot is not None
            tool = replace(snapshot.tool, position=snapshot.tool.position + 1.0)
            polled = replace(snapshot, asked_s=self.now_s, at_s=self.now_s, tool=tool)
            self.state = replace(self.state, snapshot=polled, at_s=self.now_s)
            each()
            self.recorder.turn()

    def alarms(self, problem: Problem = ALARM, priority: Priority = Priority.HIGH) -> None:
        self.state = replace(self.state, alarms=raise_alarm(self.state.alarms, problem, priority, self.now_s))

    def stops(self, reason: str) -> None:
        self.state = replace(self.state, stop=StopState(reason=reason, killed=False, sent_s=self.now_s))

    @property
    def frozen(self) -> list[Recording]:
        """The frozen recordings, oldest first."""
        return [read_recording(path) for path in reversed(frozen_in(self.data))]


def reasons(recording: Recording) -> list[str]:
    """What a recording was frozen for."""
    return [cause.reason for cause in recording.header.causes]
