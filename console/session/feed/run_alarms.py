"""Alarms of `console run`, by its status polls: what the controller reports, and a motion that lost its host."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from console.session.station.actions import alarm_events
from console.session.station.alarms import Alarms, Priority, raised, with_faults
from drivers.lathe.snapshot import Snapshot
from profiles.problem import Problem

Note = Callable[[str, Mapping[str, object]], object]
"""Adds an event to the record of the run; returns at once."""


class GuardedMotion(Protocol):
    """The heartbeat of the machine, as far as it is asked here."""

    def loss(self, lost: int) -> Problem | None:
        """Return why something was ended without its host; `lost` is what the controller reports of it."""


class RunAlarms:
    """What stands now. Nobody acknowledges: an alarm ends with its cause, that of a lapse with the next motion."""

    def __init__(self, note: Note = lambda *_: None) -> None:
        self.standing: Alarms = ()
        self.heartbeat: GuardedMotion | None = None
        self._note = note

    def see(self, snapshot: Snapshot, during: str) -> None:
        """Take a poll, `during` rest or a program; returns at once."""
        loss = None if self.heartbeat is None else self.heartbeat.loss(snapshot.lost)
        if not (self.standing or loss or snapshot.axis_faults):
            return
        faults = tuple(alarm for alarm in self.standing if alarm.faults)
        after = with_faults(faults, snapshot.axis_faults, snapshot.at_s, during)
        if loss is not None:
            before = tuple(alarm for alarm in self.standing if alarm.problem == loss)
            after = (*after, *before) if before else raised(after, loss, Priority.HIGH, snapshot.at_s)
        after = tuple(alarm for alarm in after if alarm.active)
        for kind, data in alarm_events(self.standing, after):
            self._note(kind, data)
        self.standing = after
