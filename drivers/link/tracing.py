"""Record every byte of a link in both directions, in readable form, into one file for all links of a command.

    12.345 > #1P
    12.351 < 125.5
    12.351 < [ACK]
    12.400 ! [^K]

Each line of the trace is one line of the dialogue, with the time (s) of its last byte; `!` is a stop, sent with
priority. Its CR is not shown: `[no CR]` marks a missing one, `[CR]` stands for an empty line.
"""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Protocol

from drivers.errors import DriverError, LinkError
from drivers.link.base import Link
from drivers.link.passing import PassingLink, Tap, TappedLink
from profiles.problem import Problem

CR, ACK, NUL = 0x0D, 0x06, 0x00
LONGEST_LINE = 4096  # bytes; input that never sends CR is not buffered for ever
_NAMES = {NUL: "NUL", 0x02: "STX", ACK: "ACK", 0x07: "BEL", 0x0A: "LF", CR: "CR"}
_ENDS = rb"\x00\x01\x03-\x06\x08\x0b-\x1f"  # CR, and control characters that end a line as it does, but are shown
_PIECES = re.compile(rb"([^%b]*)([%b]?)" % (_ENDS, _ENDS))


class Sink(Protocol):
    """The file of the lines."""

    def write(self, text: str, /) -> object:
        """Append a line, perhaps from a signal handler."""


class Dialogue:
    """Makes lines of the bytes of a link; `put` gets the time (s), the mark and the text of each."""

    def __init__(self, put: Callable[[float, str, str], object]) -> None:
        self._put = put
        self._lines = {">": bytearray(), "<": bytearray()}

    def take_bytes(self, now_s: float, mark: str, data: bytes) -> None:
        """Take bytes of one direction; those of the other begin a new line."""
        self.end(now_s, "<" if mark == ">" else ">")
        line = self._lines[mark]
        for text, end in _PIECES.findall(data):
            line += text
            while len(line) >= LONGEST_LINE:
                self._put(now_s, mark, f"{format_bytes(line[:LONGEST_LINE])} [no CR]")
                del line[:LONGEST_LINE]
            if end:
                self._put(now_s, mark, format_bytes(line + end.strip(b"\r")) or "[CR]")
                line.clear()

    def end(self, now_s: float, mark: str) -> None:
        """Put out a line that has no end yet."""
        if line := self._lines[mark]:
            self._put(now_s, mark, f"{format_bytes(line)} [no CR]")
            line.clear()


class TracedLink(PassingLink):
    """Passes everything on to `link`. A trace that fails ends, and the link continues without it."""

    def __init__(self, link: Link, file: Sink, now_s: Callable[[], float]) -> None:
        """Wrap `link`; `now_s` gives the times that are written."""
        super().__init__(link)
        self._file, self._now_s = file, now_s
        self._dialogue = Dialogue(self._put)
        self.problem: Problem | None = None
        """What ended the trace, `link.trace_lost`; None while it continues."""

    def send(self, data: bytes) -> None:
        """Send bytes in order."""
        now_s = self._now_s()
        self._dialogue.end(now_s, "<")
        try:
            super().send(data)
        except LinkError as error:
            self._dialogue.take_bytes(now_s, ">", data)
            self._fail(now_s, error)
            raise
        self._dialogue.take_bytes(now_s, ">", data)

    def note_urgent(self, data: bytes, failure: LinkError | None) -> None:
        """Record a stop."""
        unsent = "" if failure is None else f" [not sent: {failure.problems[0].code}]"
        self._put(self._now_s(), "!", f"{format_bytes(data)}{unsent}")

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        try:
            data = super().receive(timeout_s)
        except LinkError as error:
            self._fail(self._now_s(), error)
            raise
        if data:
            self._dialogue.take_bytes(self._now_s(), "<", data)
        return data

    def close(self) -> None:
        """Close the link."""
        now_s = self._now_s()
        self._dialogue.end(now_s, ">")
        self._dialogue.end(now_s, "<")
        self._link.close()

    def _fail(self, now_s: float, error: LinkError) -> None:
        problem = error.problems[0]
        self._put(now_s, "*", " ".join(part for part in (problem.code, problem.value) if part))

    def _put(self, now_s: float, mark: str, text: str) -> None:
        if self.problem is not None:
            return
        try:
            self._file.write(f"{now_s:.3f} {mark} {text}\n")
        except Exception as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            self.problem = Problem(code="link.trace_lost", where=self.address, value=reason)


def format_bytes(data: bytes | bytearray) -> str:
    """Return bytes as text, with unprintable ones by name."""
    return data.decode("latin-1").translate(_SHOWN)


def _format_byte(byte: int) -> str:
    if byte in _NAMES:
        return f"[{_NAMES[byte]}]"
    if byte < 0x20:
        return f"[^{chr(byte + 0x40)}]"
    # A bracket in the dialogue must not look like one of the trace's own marks.
    return chr(byte) if byte < 0x7F and byte != 0x5B else f"[{byte:#04x}]"


_SHOWN = [_format_byte(byte) for byte in range(0x100)]


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
        """Write nothing more; the descriptor stays reserved: a stop in another thread may be about to write."""
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

    def __init__(self, path: Path | None, title: str, tap: Tap | None = None) -> None:
        """Open the file, before anything moves; `tap` hears the same bytes without making lines of them.

        Raises DriverError: `link.trace_unwritable`.
        """
        self._file = None if path is None else TraceFile(path, title)
        self._tap = tap
        self._traced: list[TracedLink] = []

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Return the problem that ended the trace, if any; reported once."""
        return tuple(link.problem for link in self._traced if link.problem is not None)[:1]

    def trace_link(self, link: Link, now_s: Callable[[], float]) -> Link:
        """Return the link with its trace; `now_s` gives the times that are written."""
        link = link if self._tap is None else TappedLink(link, self._tap)
        if self._file is None:
            return link
        traced = TracedLink(link, self._file, now_s)
        self._traced.append(traced)
        return traced
