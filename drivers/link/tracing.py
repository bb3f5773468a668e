"""Trace the links of a command into one file: appended to, limited in size, and never blocking."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from drivers.errors import DriverError
from drivers.link.base import Link
from drivers.link.trace import TracedLink
from profiles.problem import Problem

LIMIT_BYTES = 64 * 1024 * 1024  # size limit: some hours of a machine that is polled twenty times a second
_FLAGS = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NONBLOCK
_READABLE_BY_ALL = 0o644


class TraceFile:
    """Writes each line at once, in one piece, from any thread or signal handler.

    At its limit the file is renamed `NAME.1`, replacing an older one, and a new file begins.
    """

    def __init__(self, path: Path, title: str, limit_bytes: int = LIMIT_BYTES) -> None:
        """Open the file and write a title line with the time. Raises DriverError: `link.trace_unwritable`."""
        self._path, self._limit_bytes = path, limit_bytes
        self._turning = threading.Lock()
        began = datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            self._file = os.open(path, _FLAGS, _READABLE_BY_ALL)
            try:
                self._length = os.fstat(self._file).st_size
                self.write(f"# {began} {title}\n")
            except OSError:
                os.close(self._file)
                raise
        except OSError as error:
            reason = error.strerror or str(error)
            raise DriverError(Problem(code="link.trace_unwritable", where=str(path), value=reason)) from error

    def write(self, text: str) -> None:
        """Append. Raises OSError: it cannot be written."""
        data = text.encode("utf-8")
        # A second writer does not wait while the file is being renewed.
        if self._length + len(data) > self._limit_bytes and self._turning.acquire(blocking=False):
            try:
                self._begin_anew()
            finally:
                self._turning.release()
        self._length += len(data)
        if os.write(self._file, data) < len(data):
            raise OSError("no room for a whole line")

    def close(self) -> None:
        """Write nothing more.

        The file descriptor stays reserved: a stop in another thread may be about to write, and must not hit
        another file.
        """
        self._become(os.open(os.devnull, os.O_WRONLY | os.O_CLOEXEC))

    def _begin_anew(self) -> None:
        if self._path.is_file():
            os.replace(self._path, f"{self._path}.1")
            self._become(os.open(self._path, _FLAGS, _READABLE_BY_ALL))
        self._length = 0

    def _become(self, other: int) -> None:
        os.dup2(other, self._file, inheritable=False)
        os.close(other)


class Tracing:
    """One trace file for all links of a command, one after the other; or none."""

    def __init__(self, path: Path | None, title: str) -> None:
        """Open the file, before anything moves. Raises DriverError: `link.trace_unwritable`."""
        self._file = None if path is None else TraceFile(path, title)
        self._traced: list[TracedLink] = []

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Return the problem that ended the trace, if any; reported once."""
        return tuple(link.problem for link in self._traced if link.problem is not None)[:1]

    def of(self, link: Link, now_s: Callable[[], float]) -> Link:
        """Return the link with its trace; `now_s` gives the times that are written."""
        if self._file is None:
            return link
        traced = TracedLink(link, self._file, now_s)
        self._traced.append(traced)
        return traced
