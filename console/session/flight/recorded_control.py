"""The control of a machine with its recording: what the keys ask for is noted once it was passed on."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from console.session.flight.notes import Inbox, Kind, command_words
from console.session.flight.recorder import Recorder
from console.session.station.alarms import Alarms, seen
from console.session.station.commands import Acknowledge, Command, Control
from console.session.station.state import StationState


class RecordedControl:
    """Passes everything on at once; shows the alarms of the recorder after those of the machine."""

    def __init__(self, control: Control, recorder: Recorder, inbox: Inbox) -> None:
        self._control, self._recorder, self._inbox = control, recorder, inbox
        self._joined: tuple[StationState, Alarms, StationState] | None = None

    @property
    def state(self) -> StationState:
        """The newest state."""
        state, alarms, joined = self._control.state, self._recorder.alarms, self._joined
        if not alarms:
            return state
        if joined is None or joined[0] is not state or joined[1] is not alarms:
            joined = self._joined = (state, alarms, replace(state, alarms=(*state.alarms, *alarms)))
        return joined[2]

    def now_s(self) -> float:
        """Return machine time."""
        return self._control.now_s()

    def post(self, intent: Command) -> bool:
        """Post a command."""
        taken = self._control.post(intent)
        if isinstance(intent, Acknowledge):
            self._recorder.acknowledge(partial(seen, shown=intent.shown))
        self._inbox.put(Kind.COMMAND, f"{command_words(intent)}{'' if taken else ' refused'}")
        return taken

    def stop(self, reason: str) -> None:
        """Stop the machine now; note it afterwards."""
        self._control.stop(reason)
        self._inbox.put(Kind.STOP, reason)

    def kill(self, reason: str) -> None:
        """Open every loop now; note it afterwards."""
        self._control.kill(reason)
        self._inbox.put(Kind.KILL, reason)

    def beat(self) -> None:
        """Signal that the screen is alive."""
        self._control.beat()
