"""A second connection to a controller's Ethernet board, for stops alone."""

from __future__ import annotations

from drivers.errors import LinkError
from drivers.link.connection import Connection


class StopConnection:
    """Nothing but stops goes here, so that no pending reply is in front of one.

    Used from any thread and from signal handlers: what two of them read at the same time is an answer for both.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._unanswered = False
        self.alive = True

    def send(self, frame: bytes) -> bool:
        """Send a stop; return whether that will do: it went, and nothing says that nobody hears it."""
        self.look()
        will_do = self.alive and not self._unanswered
        if self.alive:
            self._unanswered = True
            try:
                self._connection.write_whole(frame)
            except LinkError:
                self.alive = will_do = False
        return will_do

    def look(self) -> None:
        """Take what the board has answered, and find out whether the connection is still there."""
        try:
            while self.alive and self._connection.read():
                self._unanswered = False
        except LinkError:
            self.alive = False

    def close(self) -> None:
        """Close the connection."""
        self.alive = False
        self._connection.close()
