"""A recording that is played: where it is, how fast it goes, and what happened in it.

A time shows the newest state at that time, so that the same time shows the same however it was reached.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from itertools import pairwise

from console.flight.notes import NoteKind
from console.flight.recorded_forms import RecordedMoment
from console.flight.recording import Recording
from console.session.station.alarms import Alarm, Priority
from console.session.station.commands import Command
from console.session.station.history.alarm_history import Instant
from console.session.station.history.session_log import SessionLog, command_entry, with_state
from console.session.station.state import StationState
from profiles.problem import Problem

COMMANDS = frozenset(each.__name__ for each in Command.__subclasses__() if each.logged)
SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
JUST_S = 0.5  # an event that was passed less than this ago while playing is not the one before


class PlaybackEventKind(StrEnum):
    """Kinds of events that the states show."""

    ALARM = "alarm"
    ALARM_OVER = "alarm_over"
    STOPPED = "stopped"
    REST = "rest"
    ACTIVITY = "activity"
    PAGE = "page"
    ANSWER = "answer"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaybackEvent:
    """One event at machine time: a fact of the states with its problem or its word, or a note."""

    at_s: float
    kind: PlaybackEventKind | NoteKind
    word: str = ""
    problem: Problem | None = None
    is_low: bool = False


def logs_of(recording: Recording) -> tuple[SessionLog, ...]:
    """Return for each moment the log of the session as far as it is recorded; alarms are numbered from 1."""
    commands = deque(note for note in recording.notes if note.kind is NoteKind.COMMAND)
    log, found = SessionLog(), []
    for at_s, moment in zip(recording.times_s, recording.moments, strict=True):
        now = Instant(now_s=at_s, clock=datetime.fromtimestamp(recording.header.utc_of(at_s)))
        while commands and commands[0].at_s <= at_s:
            note = commands.popleft()
            name, *more = note.text.split() or [""]
            if name in COMMANDS:
                log = log.with_entries(
                    command_entry(name, taken=more[-1:] != ["refused"], at=now.local_time_at(note.at_s))
                )
        log = with_state(log, moment.state, moment.said, now)
        found.append(log)
    return tuple(found)


MARKED = frozenset(
    {PlaybackEventKind.ALARM, PlaybackEventKind.STOPPED, NoteKind.KEY, NoteKind.STOP, NoteKind.KILL}
)
"""Events that have a mark on the time bar, and to which the keys jump."""


def events_of(recording: Recording) -> tuple[PlaybackEvent, ...]:
    """Return what happened, in the order of the times."""
    first = recording.moments[0]
    found = _find_events_between(RecordedMoment(state=StationState()), first, recording.times_s[0])
    for (before, now), at_s in zip(pairwise(recording.moments), recording.times_s[1:], strict=True):
        if before is not now:
            found += _find_events_between(before, now, at_s)
    found += [PlaybackEvent(at_s=note.at_s, kind=note.kind, word=note.text) for note in recording.notes]
    return tuple(sorted(found, key=lambda event: event.at_s))


def _find_events_between(before: RecordedMoment, now: RecordedMoment, at_s: float) -> list[PlaybackEvent]:
    found: list[PlaybackEvent] = []
    old, new = before.state, now.state
    if old.activity is not new.activity:
        found.append(PlaybackEvent(at_s=at_s, kind=PlaybackEventKind.ACTIVITY, word=new.activity))
    if before.page != now.page:
        found.append(PlaybackEvent(at_s=at_s, kind=PlaybackEventKind.PAGE, word=now.page))
    if old.alarms is not new.alarms:
        known, present = _active(old.alarms), _active(new.alarms)
        found += [_alarm(PlaybackEventKind.ALARM, present[key], at_s) for key in present if key not in known]
        found += [_alarm(PlaybackEventKind.ALARM_OVER, known[key], at_s) for key in known if key not in present]
    if new.stop is not None:
        if old.stop is None or old.stop.sent_s != new.stop.sent_s:
            found.append(PlaybackEvent(at_s=at_s, kind=PlaybackEventKind.STOPPED, word=new.stop.reason))
        if new.stop.rest_s is not None and (old.stop is None or old.stop.rest_s is None):
            seconds = new.stop.rest_s - new.stop.sent_s
            found.append(PlaybackEvent(at_s=at_s, kind=PlaybackEventKind.REST, word=f"{seconds:.1f}"))
    answers = (*now.said, *new.refusals)
    if answers != (*before.said, *old.refusals):
        found += [PlaybackEvent(at_s=at_s, kind=PlaybackEventKind.ANSWER, problem=problem) for problem in answers]
    return found


def _active(alarms: tuple[Alarm, ...]) -> dict[tuple[str, str], Alarm]:
    return {(alarm.problem.code, alarm.problem.key): alarm for alarm in alarms if alarm.active}


def _alarm(kind: PlaybackEventKind, alarm: Alarm, at_s: float) -> PlaybackEvent:
    return PlaybackEvent(at_s=at_s, kind=kind, problem=alarm.problem, is_low=alarm.priority is Priority.LOW)


@dataclass
class Playback:
    """The place in a recording; every method leaves it within. `speed` is in recorded seconds a second."""

    recording: Recording
    at_s: float = field(init=False)
    speed: float = 1.0
    playing: bool = True

    def __post_init__(self) -> None:
        self.at_s = self.recording.times_s[0]
        self.events = events_of(self.recording)
        self._logs = logs_of(self.recording)
        self._marked_s = sorted({event.at_s for event in self.events if event.kind in MARKED})

    @property
    def place(self) -> int:
        """The number of the moment that is shown."""
        return self.recording.place_at(self.at_s)

    @property
    def moment(self) -> RecordedMoment:
        """The moment that is shown."""
        return self.recording.moments[self.place]

    @property
    def log(self) -> SessionLog:
        """The log of the session up to the moment that is shown."""
        return self._logs[self.place]

    @property
    def past_s(self) -> float:
        """The time from the beginning."""
        return self.at_s - self.recording.times_s[0]

    def advance(self, seconds: float) -> None:
        """Let real time pass; at the end it pauses."""
        if self.playing:
            self.seek(seconds * self.speed)
            self.playing = self.at_s < self.recording.times_s[-1]

    def seek(self, seconds: float) -> None:
        """Go forward or back."""
        first_s, last_s = self.recording.times_s[0], self.recording.times_s[-1]
        self.at_s = min(max(self.at_s + seconds, first_s), last_s)

    def toggle(self) -> None:
        """Play or pause; at the end play from the beginning."""
        if not self.playing and self.at_s >= self.recording.times_s[-1]:
            self.at_s = self.recording.times_s[0]
        self.playing = not self.playing

    def step(self, frames: int) -> None:
        """Pause, and go so many moments forward or back."""
        self.playing = False
        place = min(max(self.place + frames, 0), len(self.recording.moments) - 1)
        self.at_s = self.recording.times_s[place]

    def change_speed(self, steps: int) -> None:
        """Play faster or slower."""
        place = SPEEDS.index(self.speed) + steps
        self.speed = SPEEDS[min(max(place, 0), len(SPEEDS) - 1)]

    def to_event(self, direction: int) -> None:
        """Go to the next or the previous marked event; to the end where there is none."""
        if direction > 0:
            after = [at_s for at_s in self._marked_s if at_s > self.at_s]
            target_s = after[0] if after else self.recording.times_s[-1]
        else:
            limit_s = self.at_s - (JUST_S if self.playing else 0.0)
            before = [at_s for at_s in self._marked_s if at_s < limit_s]
            target_s = before[-1] if before else self.recording.times_s[0]
        self.seek(target_s - self.at_s)


class ReplayControl:
    """A control without a machine: it shows what is played, and takes no command. `refuse` is told of each."""

    def __init__(self, playback: Playback) -> None:
        self.playback = playback
        self.asked = 0

    @property
    def state(self) -> StationState:
        """The state that is shown."""
        return self.playback.moment.state

    @property
    def side(self) -> None:
        """There is no controller."""
        return None

    def now_s(self) -> float:
        """Return the machine time of the state: its age is what it was."""
        recording = self.playback.recording
        return recording.times_s[self.playback.place]

    def post(self, intent: Command) -> bool:
        """Refuse a command."""
        self.asked += 1
        return False

    def stop(self, reason: str) -> None:
        """Stop nothing."""
        self.asked += 1

    def kill(self, reason: str) -> None:
        """Open no loop."""
        self.asked += 1

    def beat(self) -> None:
        """Do nothing: nobody watches the screen."""
