"""Follows the running consoles of one machine, or of all: they come, end, are killed, stall, and come back.

Nobody is waited for: a console that does not answer holds up neither another one nor who reads this.
"""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.feed.feed_state import FeedState, rank, read_state
from console.session.feed.place import connect_feed, feeds
from console.session.feed.request import SCHEMA, request_line
from profiles.files import printable
from profiles.problem import Problem

SILENT_S = 5.0  # a console sends a line a second at the least
RESCAN_S = 1.0
SETTLE_S = 0.1
CONNECT_S = 0.5  # the system answers at once, or there are too many readers
LONGEST_LINE = 1_000_000
CHUNK = 65_536
NO_STATE = b"\0"  # begins what is kept of a line that is too long

Warn = Callable[[Problem], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedState:
    """A state of the feed, and when it came (`time.monotonic`)."""

    state: FeedState
    came_s: float

    def age_state(self, now_s: float) -> FeedState:
        """Return the state with the age that its values have now."""
        age_s = self.state.age_s
        return replace(self.state, age_s=None if age_s is None else age_s + now_s - self.came_s)


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


def closed_feed_problem(path: Path, error: OSError) -> Problem:
    """Return that a feed cannot be read."""
    return Problem(code="feed.closed", where=printable(str(path)), value=error.strerror or str(error))


class Follower:
    """The consoles whose states are `wanted`: all, or those that work one machine, the real or the simulated one.

    `newest` has what they sent last; `seen` is called with each state, after that before it, None for the first.
    """

    def __init__(
        self,
        data: Path,
        hz: float,
        wanted: Callable[[FeedState], bool],
        warn: Warn,
        seen: Callable[[FeedState | None, FeedState], None] = lambda *_: None,
    ) -> None:
        self._data, self._hz, self._wanted, self._seen = data, hz, wanted, seen
        self._warn, self._warned = warn, set[tuple[str, str]]()
        self._streams: dict[Path, Stream] = {}
        self.newest: dict[Path, ReceivedState] = {}
        self._left: set[Path] = set()  # work another machine, or publish something else
        self._scanned_s = float("-inf")

    def close(self) -> None:
        """Leave every console."""
        for path in list(self._streams):
            self._drop(path)

    def settle(self) -> list[ReceivedState]:
        """Wait until each console that runs has sent a state, or is silent; return the states."""
        until_s, waiting = time.monotonic() + SILENT_S, {self._data}
        while waiting and time.monotonic() < until_s:
            self.wait(SETTLE_S)
            waiting = self._streams.keys() - self.newest.keys()
        for path in waiting:
            self._complain(not_one(path, f"> {SILENT_S:g} s"))
        return self.newest_states()

    def wait(self, timeout_s: float) -> ReceivedState | None:
        """Wait for something new, at most so long; return the newest state of the machine, None without a console.

        Of several consoles on one machine it is that which controls it, else the one with the newest values.
        """
        self._scan()
        paths = {stream: path for path, stream in self._streams.items()}
        if not paths:
            time.sleep(timeout_s)
            return None
        ready, _, _ = select.select(list(paths), [], [], timeout_s)
        for stream in ready:
            self._take(paths[stream], stream)
        return max(self.newest_states(), key=lambda each: rank(each.state), default=None)

    def newest_states(self) -> list[ReceivedState]:
        """Return the newest state of each console that is not silent."""
        now_s = time.monotonic()
        return [each for each in self.newest.values() if now_s - each.came_s < SILENT_S]

    def _scan(self) -> None:
        """Connect to consoles that are new, forget those that are gone."""
        if time.monotonic() - self._scanned_s < RESCAN_S:
            return
        self._scanned_s = time.monotonic()
        try:
            found = set(feeds(self._data))
        except OSError as error:
            self._complain(closed_feed_problem(self._data, error))
            return
        self._left &= found
        for path in sorted(found - self._left - set(self._streams)):
            self._join(path)

    def _join(self, path: Path) -> None:
        try:
            link = connect_feed(path, CONNECT_S)
        except (ConnectionError, FileNotFoundError, TimeoutError, BlockingIOError):
            return  # it was killed, ends now, or is too busy: the next look tells
        except OSError as error:
            self._complain(closed_feed_problem(path, error))
            return
        try:
            self._streams[path] = Stream(path, link, self._hz, self._complain)
        except OSError:
            link.close()

    def _take(self, path: Path, stream: Stream) -> None:
        try:
            for state in stream.take():
                if not self._wanted(state) and path in self.newest:  # a console stays at its machine
                    self._complain(not_one(path, state.machine))
                    continue
                if not self._wanted(state):
                    self._drop(path)
                    self._left.add(path)
                    return
                before = self.newest.get(path)
                self.newest[path] = ReceivedState(state=state, came_s=time.monotonic())
                self._seen(None if before is None else before.state, state)
        except OSError:
            self._drop(path)

    def _complain(self, problem: Problem) -> None:
        """Say it once for each place."""
        if (key := (problem.code, problem.where)) not in self._warned:
            self._warned.add(key)
            self._warn(problem)

    def _drop(self, path: Path) -> None:
        self.newest.pop(path, None)
        with suppress(OSError):
            self._streams.pop(path).close()
