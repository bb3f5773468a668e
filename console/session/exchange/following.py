"""Follows the running consoles of one machine: they come, end, are killed, stall, and come back.

Nobody is waited for: a console that does not answer holds up neither another one nor who reads this.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from console.session.errors import SessionError
from console.session.exchange.data_items import Published, published
from console.session.feed.client import Stream
from console.session.feed.place import connected, feeds
from console.session.feed.request import SCHEMA
from profiles.files import printable
from profiles.problem import Problem

SILENT_S = 5.0  # a console sends a line a second at the least
RESCAN_S = 1.0
CONNECT_S = 0.5  # the system answers at once, or there are too many readers

BROKEN = (KeyError, TypeError, ValueError, AttributeError)
"""What a state without its values comes to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """A state of the feed, what is published of it, and when it came (`time.monotonic`)."""

    state: dict[str, Any]
    published: Published
    came_s: float


class Follower:
    """The consoles that work one machine, the real or the simulated one."""

    def __init__(
        self, data: Path, hz: float, machine: str, simulated: bool, warn: Callable[[Problem], object]
    ) -> None:
        self._data, self._hz = data, hz
        self._wanted = machine, simulated
        self._warn, self._warned = warn, set[tuple[str, str]]()
        self._streams: dict[Path, Stream] = {}
        self._newest: dict[Path, Heard] = {}
        self._left: set[Path] = set()  # work another machine, or publish something else
        self._scanned_s = float("-inf")

    def close(self) -> None:
        """Leave every console."""
        for path in list(self._streams):
            self._drop(path)

    def wait(self, timeout_s: float) -> Heard | None:
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
        return self._chosen()

    def _chosen(self) -> Heard | None:
        now_s = time.monotonic()
        heard = [each for each in self._newest.values() if now_s - each.came_s < SILENT_S]
        return max(heard, key=lambda each: _rank(each.state), default=None)

    def _scan(self) -> None:
        """Connect to consoles that are new, forget those that are gone."""
        if time.monotonic() - self._scanned_s < RESCAN_S:
            return
        self._scanned_s = time.monotonic()
        try:
            found = set(feeds(self._data))
        except OSError as error:
            self._complain(Problem(code="feed.closed", where=str(self._data), value=error.strerror or str(error)))
            return
        self._left &= found
        for path in sorted(found - self._left - set(self._streams)):
            self._join(path)

    def _join(self, path: Path) -> None:
        try:
            link = connected(path, CONNECT_S)
        except (ConnectionError, FileNotFoundError, TimeoutError, BlockingIOError):
            return  # it was killed, ends now, or is too busy: the next look tells
        except OSError as error:
            self._complain(Problem(code="feed.closed", where=str(path), value=error.strerror or str(error)))
            return
        try:
            self._streams[path] = Stream(path, link, self._hz)
        except OSError:
            link.close()

    def _take(self, path: Path, stream: Stream) -> None:
        try:
            for state in stream.take():
                if (state["machine"], state["simulated"]) != self._wanted:
                    self._leave(path)
                    return
                shown = published(state, "")
                self._newest[path] = Heard(state=state, published=shown, came_s=time.monotonic())
        except OSError:
            self._drop(path)
        except SessionError as error:
            self._complain(error.problems[0])
            self._leave(path)
        except BROKEN as error:
            where = printable(str(path))
            self._complain(Problem(code="feed.not_one", where=where, value=str(error), limit=str(SCHEMA)))
            self._leave(path)

    def _leave(self, path: Path) -> None:
        self._drop(path)
        self._left.add(path)

    def _drop(self, path: Path) -> None:
        self._newest.pop(path, None)
        with suppress(OSError):
            self._streams.pop(path).close()

    def _complain(self, problem: Problem) -> None:
        """Say it once for each place."""
        if (key := (problem.code, problem.where)) not in self._warned:
            self._warned.add(key)
            self._warn(problem)


def _rank(state: dict[str, Any]) -> tuple[bool, bool, bool, str]:
    return state["controls"], state["execution"] != "unavailable", not state["stale"], state["at_utc"]
