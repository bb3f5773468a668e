"""A control that passes everything on to another one: the base of those that note or add something."""

from __future__ import annotations

from typing import TYPE_CHECKING

from console.session.station.state import StationState

if TYPE_CHECKING:
    from console.session.station.commands import Command, Control
    from drivers.beside.side_line import SideLine


class PassingControl:
    """Passes everything on at once."""

    def __init__(self, control: Control) -> None:
        self._control = control

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
        self._control.stop(reason)

    def kill(self, reason: str) -> None:
        """Open every loop now."""
        self._control.kill(reason)

    def beat(self) -> None:
        """Signal that the screen is alive."""
        self._control.beat()
