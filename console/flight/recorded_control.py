"""The control of a machine with its recording: what the keys ask for is noted once it was passed on."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from console.flight.notes import Inbox, NoteKind, command_words
from console.session.passing_control import PassingControl, record
from console.session.station.alarms import Alarms, acknowledge_shown_alarms
from console.session.station.state import StationState

if TYPE_CHECKING:
    from console.flight.recorder import FlightRecorder
    from console.session.station.commands import Command, Control


class RecordedControl(PassingControl):
    """Passes everything on at once; shows the alarms of the recorder after those of the machine.

    There is a `recorder` after the first paint.
    """

    def __init__(self, control: Control, inbox: Inbox) -> None:
        super().__init__(control, inbox.put)
        self.recorder: FlightRecorder | None = None
        self._inbox = inbox
        self._joined: tuple[StationState, Alarms, StationState] | None = None

    @property
    def state(self) -> StationState:
        """The newest state."""
        state, recorder, joined = super().state, self.recorder, self._joined
        if recorder is None or not recorder.alarms:
            return state
        alarms = recorder.alarms
        if joined is None or joined[0] is not state or joined[1] is not alarms:
            joined = self._joined = (state, alarms, replace(state, alarms=(*state.alarms, *alarms)))
        return joined[2]

    def post(self, intent: Command) -> bool:
        """Post a command."""
        from console.session.station.commands import Acknowledge  # not for the first paint

        taken = super().post(intent)
        if self.recorder is not None and isinstance(intent, Acknowledge):
            self.recorder.acknowledge(partial(acknowledge_shown_alarms, shown=intent.shown))
        record((self._inbox.put,), NoteKind.COMMAND, f"{command_words(intent)}{'' if taken else ' refused'}")
        return taken
