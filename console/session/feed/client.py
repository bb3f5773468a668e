"""The reading end of a feed: lines of one console as values, within bounds."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from pathlib import Path

from console.session.errors import SessionError
from console.session.feed.feed_state import FeedState, read_state
from console.session.feed.place import FOLDER, connected, feeds
from console.session.feed.request import SCHEMA, request_line
from profiles.files import printable
from profiles.problem import Problem

TIMEOUT_S = 5.0  # a console sends its first line at once
LONGEST_LINE = 1_000_000
CHUNK = 65_536
NO_STATE = b"\0"  # begins what is kept of a line that is too long

Warn = Callable[[Problem], object]


def warn_once(warn: Warn) -> Warn:
    """Return `warn` for the first problem of a kind at each place."""
    told: set[tuple[str, str]] = set()

    def tell(problem: Problem) -> None:
        if (key := (problem.code, problem.where)) not in told:
            told.add(key)
            warn(problem)

    return tell


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


class Reader(Stream):
    """A connection to a feed that has sent its first state. `last` is the state that came last."""

    def __init__(self, path: Path, link: socket.socket, hz: float, warn: Warn) -> None:
        """Ask for a rate, and wait for the first state. Raises OSError."""
        super().__init__(path, link, hz, warn)
        until_s = time.monotonic() + TIMEOUT_S
        while not (first := super().take()):
            if time.monotonic() > until_s:
                raise TimeoutError
        self.last = first[-1]
        self.waiting = first

    def take(self) -> list[FeedState]:
        """Return the states that have come, as `Stream.take`, and keep the last one."""
        found = super().take()
        if found:
            self.last = found[-1]
        return found


def readers(data: Path, hz: float, machine: str | None = None, warn: Warn = lambda _: None) -> list[Reader]:
    """Return a reader of each feed in a data folder, of one machine where it is named.

    A feed that is closed, or sends no state, is a warning beside others. Raises SessionError: `feed.none`, no
    console runs there; `feed.unknown`, none works the machine; `feed.closed`, `feed.not_one`, of all that do.
    """
    found, problems, warn = list[Reader](), list[Problem](), warn_once(warn)
    try:
        paths = feeds(data)
    except OSError as error:
        raise SessionError(closed(data / FOLDER, error)) from error
    try:
        for path in paths:
            reader = _reader(path, hz, warn)
            if isinstance(reader, Reader):
                found.append(reader)
            elif reader is not None:
                problems.append(reader)
        names = sorted({each.last.machine for each in found})
        if not found:
            raise SessionError(*problems or [Problem(code="feed.none", where=printable(str(data)))])
        for problem in problems:
            warn(problem)
        if machine is not None and machine not in names:
            raise SessionError(Problem(code="feed.unknown", value=machine, limit=", ".join(names)))
    except BaseException:
        for each in found:
            each.close()
        raise
    for each in found:
        if machine not in (None, each.last.machine):
            each.close()
    return [each for each in found if machine in (None, each.last.machine)]


def closed(path: Path, error: OSError) -> Problem:
    """Return that a feed cannot be read."""
    return Problem(code="feed.closed", where=printable(str(path)), value=error.strerror or str(error))


def _reader(path: Path, hz: float, warn: Warn) -> Reader | Problem | None:
    """Return the reader of one feed; None of a console that was killed, or ends now."""
    link: socket.socket | None = None
    try:
        link = connected(path, TIMEOUT_S)
        return Reader(path, link, hz, warn)
    except (ConnectionError, FileNotFoundError):
        problem = None
    except TimeoutError:
        problem = not_one(path, f"> {TIMEOUT_S:g} s")
    except OSError as error:
        problem = closed(path, error)
    if link is not None:
        link.close()
    return problem
