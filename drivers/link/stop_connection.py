"""A second connection to a controller's Ethernet board, for stops alone."""

from __future__ import annotations

import time

from drivers.errors import LinkError
from drivers.link.connection import Connection
from drivers.pmac.ethernet import Direction, Request, RequestCode
from profiles.problem import Problem

OPENING_S = 2.0  # for the first answer; a network accepts connections that no board serves
ANSWER_S = 1.0  # how long the board may take to answer a stop; after that the stop may not have been received
_READY = Request(direction=Direction.UPLOAD, code=RequestCode.READREADY, length=2)


class StopConnection:
    """Carries nothing but stops, so that none queues after a pending reply.

    Used from any thread and from signal handlers: when two of them read at the same time, one answer serves both.
    """

    def __init__(self, connection: Connection) -> None:
        """Ask the board, without side effects, whether there is anything to read, and wait for its answer.

        Raises LinkError: `link.no_answer`, the board does not serve it; `link.lost`, `link.closed`.
        """
        self._connection, self._alive = connection, True
        self._asked_s: float | None = None
        try:
            connection.write_whole(_READY.encode())
            if not connection.receive(OPENING_S):
                raise LinkError(Problem(code="link.no_answer", value=f"{OPENING_S:g} s"))
        except LinkError:
            connection.close()
            raise

    @property
    def works(self) -> bool:
        """Whether the connection is open and every stop was answered in time."""
        asked_s = self._asked_s
        return self._alive and (asked_s is None or time.monotonic() - asked_s <= ANSWER_S)

    def send(self, frame: bytes) -> bool:
        """Send a stop; return whether that suffices: it was sent, and nothing suggests that it is not received."""
        self.look()
        will_do = self._alive and self._asked_s is None
        if self._alive:
            self._asked_s = self._asked_s or time.monotonic()
            try:
                self._connection.write_whole(frame)
            except LinkError:
                self._alive = will_do = False
        return will_do

    def look(self) -> None:
        """Read the board's answers and detect a lost connection."""
        try:
            while self._alive and self._connection.receive():
                self._asked_s = None
        except LinkError:
            self._alive = False

    def close(self) -> None:
        """Close the connection."""
        self._alive = False
        self._connection.close()
