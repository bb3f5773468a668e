"""A second connection to a controller's Ethernet board, for stops alone."""

from __future__ import annotations

import time

from drivers.errors import LinkError
from drivers.link.connection import Connection
from drivers.pmac.ethernet import Direction, Request, RequestCode
from profiles.problem import Problem

OPENING_S = 2.0
"""How long the board may take to answer on a new connection; a network takes one that no board serves, too."""

ANSWER_S = 1.0
"""How long it may take to answer a stop; who has not answered by then may not have heard it."""

_READY = Request(direction=Direction.UPLOAD, code=RequestCode.READREADY, length=2)


class StopConnection:
    """Nothing but stops goes here, so that no pending reply is in front of one.

    Used from any thread and from signal handlers: what two of them read at the same time is an answer for both.
    """

    def __init__(self, connection: Connection) -> None:
        """Ask the board whether something is to be read here, which changes nothing, and wait for its answer.

        Raises:
            LinkError: `link.no_answer`, the board does not serve it; `link.lost`, `link.closed`.
        """
        self._connection = connection
        self._asked_s: float | None = None
        self._alive = True
        try:
            connection.write_whole(_READY.encode())
            if not connection.read(OPENING_S):
                raise LinkError(Problem(code="link.no_answer", value=f"{OPENING_S:g} s"))
        except LinkError:
            connection.close()
            raise

    @property
    def works(self) -> bool:
        """Whether it is there, and no stop has waited too long for its answer."""
        asked_s = self._asked_s
        return self._alive and (asked_s is None or time.monotonic() - asked_s <= ANSWER_S)

    def send(self, frame: bytes) -> bool:
        """Send a stop; return whether that will do: it went, and nothing says that nobody hears it."""
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
        """Take what the board has answered, and find out whether the connection is still there."""
        try:
            while self._alive and self._connection.read():
                self._asked_s = None
        except LinkError:
            self._alive = False

    def close(self) -> None:
        """Close the connection."""
        self._alive = False
        self._connection.close()
