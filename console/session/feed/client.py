"""The reading end of a feed: lines of one console as values, within bounds."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path

from console.session.feed.feed_state import FeedState, read_state
from console.session.feed.request import SCHEMA, request_line
from profiles.files import printable
from profiles.problem import Problem

LONGEST_LINE = 1_000_000
CHUNK = 65_536
NO_STATE = b"\0"  # begins what is kept of a line that is too long

Warn = Callable[[Problem], object]


class Stream:
    """A connection to one feed, which is asked for a rate. `refused` is how many lines of it were no state."""

    def __init__(self, path: Path, link: socket.socket, hz: float, warn: Warn) -> None:
        """Ask for a rate; wait for nothing. `warn` hears of the first refused line, and of all at the end.

        Raises OSError.
        """
        self._path, self._link, self._kept, self._warn = path, link, b"", warn
        self.refused = 0
        link.sendall(request_line(hz))

    def fileno(self) -> int:
        """Return the descriptor, for a selector."""
        return self._link.fileno()

    def close(self) -> None:
        """Leave."""
        self._link.close()
        if self.refused > 1:
            self._warn(Problem(code="feed.refused", where=printable(str(self._path)), value=str(self.refused)))

    def take(self) -> list[FeedState]:
        """Return the states that have come; what is no state is skipped. Raises OSError: the console has ended."""
        data = self._link.recv(CHUNK)
        if not data:
            raise ConnectionError("EOF")
        *lines, self._kept = (self._kept + data).split(b"\n")
        if len(self._kept) > LONGEST_LINE:
            self._kept = NO_STATE
        return [state for line in lines if (state := self._state(line)) is not None]

    def _state(self, line: bytes) -> FeedState | None:
        try:
            return read_state(line)
        except (TypeError, ValueError) as error:
            self.refused += 1
            if self.refused == 1:
                self._warn(not_one(self._path, str(error)))
        return None


def not_one(path: Path, value: str) -> Problem:
    """Return that what came from a feed is no state."""
    return Problem(code="feed.not_one", where=printable(str(path)), value=printable(value, 100), limit=str(SCHEMA))


def closed(path: Path, error: OSError) -> Problem:
    """Return that a feed cannot be read."""
    return Problem(code="feed.closed", where=printable(str(path)), value=error.strerror or str(error))
