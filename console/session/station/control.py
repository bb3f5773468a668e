"""What a screen holds of the machine: it reads the newest state, posts orders, and stops.

The link thread is the one that does it; a test may put something simpler in its place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from console.session.station.commands import Command
    from console.session.station.state import StationState


class Control(Protocol):
    """The way from the operator's keys to the machine. Everything here returns at once, from any thread."""

    @property
    def state(self) -> StationState:
        """The newest state."""

    def now_s(self) -> float:
        """Return machine time, to tell the age of the state by."""

    def post(self, intent: Command) -> bool:
        """Order something. False when the machine is busy: an order is refused then, never queued."""

    def stop(self, reason: str) -> None:
        """Stop the machine now, past everything that waits."""

    def kill(self, reason: str) -> None:
        """Open every loop now; the spindle coasts."""

    def beat(self) -> None:
        """Say that the screen is alive; when this stays away while something moves, the machine is stopped."""
