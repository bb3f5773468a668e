"""A link that writes down every byte both ways, readable by a person.

    12.345 > #1P
    12.351 < 125.5
    12.351 < [ACK]
    12.400 ! [^K]

A line of the trace is one of the dialogue, with the time (s) of its last byte; `!` is a stop, past everything that
waits. Its CR is not shown: `[no CR]` says where there was none, `[CR]` stands for an empty line.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from drivers.errors import LinkError
from drivers.link.base import Link, StopWay
from profiles.problem import Problem

CR, ACK, NUL = 0x0D, 0x06, 0x00
LONGEST_LINE = 4096
"""Bytes after which a line of the trace ends in any case: something that never says CR is not kept for ever."""

_NAMES = {NUL: "NUL", 0x02: "STX", ACK: "ACK", 0x07: "BEL", 0x0A: "LF", CR: "CR"}
_ALONE = frozenset(range(0x20)) - {0x02, 0x07, 0x09, 0x0A, CR}
"""What ends a line of the trace, as a CR does, and is shown there."""


class Sink(Protocol):
    """Where the lines go: each in one call, which may come from a signal handler."""

    def write(self, text: str, /) -> object:
        """Append."""


class TracedLink:
    """Passes everything on to `link`. What goes wrong with the trace ends the trace, and nothing else."""

    def __init__(self, link: Link, file: Sink, now_s: Callable[[], float]) -> None:
        """`now_s` gives the times that are written."""
        self.address = link.address
        self._link = link
        self._file = file
        self._now_s = now_s
        self._out, self._in = bytearray(), bytearray()
        self._problem: Problem | None = None

    @property
    def problem(self) -> Problem | None:
        """What ended the trace, None while it goes on: `link.trace_lost`."""
        return self._problem

    @property
    def checks_bytes(self) -> bool:
        """Whether what arrives is what was sent."""
        return self._link.checks_bytes

    @property
    def stop_way(self) -> StopWay:
        """What a stop would go through now."""
        return self._link.stop_way

    def send(self, data: bytes) -> None:
        """Send bytes in order."""
        self._end("<", self._in)
        now_s = self._now_s()
        try:
            self._link.send(data)
        except LinkError as error:
            self._note(now_s, ">", self._out, data)
            self._fail(now_s, error)
            raise
        self._note(now_s, ">", self._out, data)

    def send_urgent(self, data: bytes) -> None:
        """Send a stop now; it is written down afterwards."""
        try:
            self._link.send_urgent(data)
        except LinkError as error:
            self._put(self._now_s(), "!", f"{shown(data)} [not sent: {error.problems[0].code}]")
            raise
        self._put(self._now_s(), "!", shown(data))

    def receive(self, timeout_s: float) -> bytes:
        """Return what has come, waiting at most `timeout_s`."""
        try:
            data = self._link.receive(timeout_s)
        except LinkError as error:
            self._fail(self._now_s(), error)
            raise
        if data:
            self._end(">", self._out)
            self._note(self._now_s(), "<", self._in, data)
        return data

    def close(self) -> None:
        """Let go of the link."""
        self._end(">", self._out)
        self._end("<", self._in)
        self._link.close()

    def _note(self, now_s: float, mark: str, line: bytearray, data: bytes) -> None:
        for byte in data:
            if byte == CR:
                self._put(now_s, mark, shown(line) or "[CR]")
                line.clear()
                continue
            line.append(byte)
            if byte in _ALONE:
                self._put(now_s, mark, shown(line))
                line.clear()
            elif len(line) >= LONGEST_LINE:
                self._end(mark, line)

    def _end(self, mark: str, line: bytearray) -> None:
        """Write down what was said without an end."""
        if line:
            self._put(self._now_s(), mark, f"{shown(line)} [no CR]")
            line.clear()

    def _fail(self, now_s: float, error: LinkError) -> None:
        problem = error.problems[0]
        self._put(now_s, "*", " ".join(part for part in (problem.code, problem.value) if part))

    def _put(self, now_s: float, mark: str, text: str) -> None:
        if self._problem is not None:
            return
        try:
            self._file.write(f"{now_s:.3f} {mark} {text}\n")
        except (OSError, ValueError) as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            self._problem = Problem(code="link.trace_lost", where=self.address, value=reason)


def shown(data: bytes | bytearray) -> str:
    """Return bytes as text, with what is not printable by its name."""
    return "".join(_shown(byte) for byte in data)


def _shown(byte: int) -> str:
    if byte in _NAMES:
        return f"[{_NAMES[byte]}]"
    if byte < 0x20:
        return f"[^{chr(byte + 0x40)}]"
    # A bracket of the dialogue is not to look like one of ours.
    return chr(byte) if byte < 0x7F and byte != 0x5B else f"[{byte:#04x}]"
