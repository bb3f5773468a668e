"""The reading end of a feed: lines of one console as values, within bounds."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

from console.session.errors import SessionError
from console.session.feed.place import FOLDER, connected, feeds
from console.session.feed.request import SCHEMA, request_line
from profiles.files import printable
from profiles.problem import Problem

TIMEOUT_S = 5.0  # a console sends its first line at once
LONGEST_LINE = 1_000_000
CHUNK = 65_536


class Stream:
    """A connection to one feed, which is asked for a rate."""

    def __init__(self, path: Path, link: socket.socket, hz: float) -> None:
        """Ask for a rate; wait for nothing. Raises OSError."""
        self._path, self._link, self._kept = path, link, b""
        link.sendall(request_line(hz))

    def fileno(self) -> int:
        """Return the descriptor, for a selector."""
        return self._link.fileno()

    def close(self) -> None:
        """Leave."""
        self._link.close()

    def take(self) -> list[dict[str, Any]]:
        """Return the states that have come. Raises ConnectionError: the console has ended; SessionError."""
        data = self._link.recv(CHUNK)
        if not data:
            raise ConnectionError("EOF")
        *lines, self._kept = (self._kept + data).split(b"\n")
        if len(self._kept) > LONGEST_LINE:
            raise self._not_one(f"> {LONGEST_LINE} bytes")
        return [self._state(line) for line in lines]

    def _state(self, line: bytes) -> dict[str, Any]:
        try:
            state = json.loads(line)
            schema = state["schema"]
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise self._not_one(printable(line.decode("ascii", "replace"), 60)) from error
        if schema != SCHEMA or "machine" not in state:
            raise self._not_one(printable(str(state.get("refused", schema)), 60))
        return dict(state)

    def _not_one(self, value: str) -> SessionError:
        problem = Problem(code="feed.not_one", where=printable(str(self._path)), value=value, limit=str(SCHEMA))
        return SessionError(problem)


class Reader(Stream):
    """A connection to a feed that has sent its first state. `last` is the state that came last."""

    def __init__(self, path: Path, link: socket.socket, hz: float) -> None:
        """Ask for a rate, and wait for the first state. Raises OSError, and SessionError `feed.not_one`."""
        super().__init__(path, link, hz)
        first: list[dict[str, Any]] = []
        while not first:
            first = super().take()
        self.last = first[-1]
        self.waiting = first

    def take(self) -> list[dict[str, Any]]:
        """Return the states that have come, as `Stream.take`, and keep the last one."""
        found = super().take()
        if found:
            self.last = found[-1]
        return found


def readers(data: Path, hz: float, machine: str | None = None) -> list[Reader]:
    """Return a reader of each feed in a data folder, of one machine where it is named.

    Raises SessionError: `feed.none`, no console runs there; `feed.unknown`, none works the machine;
    `feed.closed`, `feed.not_one`.
    """
    found: list[Reader] = []
    try:
        for path in _feeds(data):
            reader = _reader(path, hz)
            found += [] if reader is None else [reader]
        names = sorted({printable(str(each.last["machine"]), 60) for each in found})
        if not found:
            raise SessionError(Problem(code="feed.none", where=printable(str(data))))
        if machine is not None and machine not in names:
            raise SessionError(Problem(code="feed.unknown", value=machine, limit=", ".join(names)))
    except BaseException:
        for reader in found:
            reader.close()
        raise
    for reader in found:
        if machine not in (None, reader.last["machine"]):
            reader.close()
    return [each for each in found if machine in (None, each.last["machine"])]


def _feeds(data: Path) -> list[Path]:
    try:
        return feeds(data)
    except OSError as error:
        raise SessionError(_closed(data / FOLDER, error)) from error


def _closed(path: Path, error: OSError) -> Problem:
    return Problem(code="feed.closed", where=printable(str(path)), value=error.strerror or str(error))


def _reader(path: Path, hz: float) -> Reader | None:
    """Return the reader of one feed; None of a console that was killed, or ends now."""
    link: socket.socket | None = None
    try:
        link = connected(path, TIMEOUT_S)
        return Reader(path, link, hz)
    except (ConnectionError, FileNotFoundError):
        problem = None
    except TimeoutError:
        problem = Problem(code="feed.not_one", where=printable(str(path)), value="-", limit=str(SCHEMA))
    except OSError as error:
        problem = _closed(path, error)
    if link is not None:
        link.close()
    if problem is not None:
        raise SessionError(problem)
    return None
