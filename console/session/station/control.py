"""Interface of the screens to the machine: read the newest state, post commands, and stop.

The link thread implements it; a test may use something simpler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from console.session.station.commands import Command
    from console.session.station.state import StationState


class Control(Protocol):
    """Interface from the operator's keys to the machine. Everything here returns at once, from any thread."""

    @property
    def state(self) -> StationState:
        """The newest state."""

    def now_s(self) -> float:
        """Return machine time, to compute the age of the state."""

    def post(self, intent: Command) -> bool:
        """Post a command. False when the machine is busy: a command is refused then, never queued."""

    def stop(self, reason: str) -> None:
        """Stop the machine now, bypassing everything that waits."""

    def kill(self, reason: str) -> None:
        """Open every loop now; the spindle coasts."""

    def beat(self) -> None:
        """Signal that the screen is alive; without it, a moving machine is stopped."""
