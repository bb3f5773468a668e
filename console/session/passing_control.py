"""A control that passes everything on to another one: the base of those that note or add something."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING

from console.session.station.state import StationState

if TYPE_CHECKING:
    from console.session.station.commands import Command, Control
    from drivers.requests.side_line import SideLine

Recorder = Callable[[str, str], object]
"""Takes what was done and why. It is called once it is done: whatever it raises changes nothing any more."""


def record(recorders: Iterable[Callable[..., object]], *noted: object) -> None:
    """Call each recorder; one that fails loses its note, and nothing else."""
    for each in recorders:
        with suppress(Exception):
            each(*noted)


class PassingControl:
    """Passes everything on at once.

    A stop goes to the innermost control directly; then each of `recorders` gets "stop" or "kill" and the reason.
    """

    def __init__(self, control: Control, *recorders: Recorder) -> None:
        self._control = control
        self.innermost: Control = control.innermost if isinstance(control, PassingControl) else control
        self.recorders: tuple[Recorder, ...] = recorders
        if isinstance(control, PassingControl):
            self.recorders = (*control.recorders, *recorders)

    @property
    def state(self) -> StationState:
        """The newest state."""
        return self._control.state

    @property
    def side(self) -> SideLine | None:
        """Where worker threads ask the controller."""
        return self._control.side

    def now_s(self) -> float:
        """Return machine time."""
        return self._control.now_s()

    def post(self, intent: Command) -> bool:
        """Post a command."""
        return self._control.post(intent)

    def stop(self, reason: str) -> None:
        """Stop the machine now."""
        self.innermost.stop(reason)
        record(self.recorders, "stop", reason)

    def kill(self, reason: str) -> None:
        """Open every loop now."""
        self.innermost.kill(reason)
        record(self.recorders, "kill", reason)

    def beat(self) -> None:
        """Signal that the screen is alive."""
        self._control.beat()
