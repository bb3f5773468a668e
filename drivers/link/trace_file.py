"""The file of a trace: appended to, bounded, and never in anybody's way."""

from __future__ import annotations

import os
import threading
from datetime import datetime
from pathlib import Path

from drivers.errors import DriverError
from profiles.problem import Problem

LIMIT_BYTES = 64 * 1024 * 1024
"""How long a file gets: some hours of a machine that is looked at twenty times a second."""

_FLAGS = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NONBLOCK
_READABLE_BY_ALL = 0o644


class TraceFile:
    """Each line is written at once, in one piece, from whatever thread or signal handler.

    At its limit the file becomes `NAME.1`, in the place of an older one, and begins anew.
    """

    def __init__(self, path: Path, title: str, limit_bytes: int = LIMIT_BYTES) -> None:
        """Open the file and write a line that tells what begins here, and when.

        Raises:
            DriverError: `link.trace_unwritable`.
        """
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
        """Append.

        Raises:
            OSError: it cannot be written.
        """
        data = text.encode("utf-8")
        # Whoever comes while another begins anew does not wait for that.
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

        The number stays taken: a stop in another thread may be about to write, and must not meet another file.
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
