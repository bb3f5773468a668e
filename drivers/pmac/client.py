"""The host's side of a PMAC: one request in flight, replies matched by framing, errors with their number."""

from __future__ import annotations

import re
from collections.abc import Iterable

from drivers.clock import Clock
from drivers.errors import ControllerError, LinkError, LinkTimeoutError
from drivers.link.base import Link
from drivers.pmac.framing import FramingError, Reply, take_reply
from profiles.problem import Problem

FLUSH = b"\x18"

REPLY_TIMEOUT_S = 2.0
QUIET_S = 0.1
DRAIN_LIMIT_S = 2.0
"""After this something that talks without end is no controller; the next reply will show it."""
_VERSION = re.compile(r"\d+\.\d+")

LINE_LIMIT = 250
"""Characters of one command line; the card's own limit is 255."""


class PmacClient:
    """Talks to one controller over one link.

    Queries and commands are told apart by their caller: nothing here is ever sent twice.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.link = link
        self._clock = clock
        self._buffer = b""

    def connect(self) -> tuple[str, str]:
        """Empty the line, set the handshake, and return version and type as the controller states them.

        Raises:
            LinkError: `link.silent`, nothing answers; `link.not_a_pmac`, something else does.
        """
        self.link.send(FLUSH)
        self._drain()
        # An earlier client may have left half a line behind: the empty line ends it, its error is not ours.
        # Checksums may be on (I4), and would stand behind every answer.
        self.link.send(b"\rI4=0\r")
        self._drain()
        try:
            self.request("I3=2 I6=1")
            version, kind = (reply.strip() for reply in self.query("VERSION", "TYPE"))
        except LinkTimeoutError:
            raise
        except LinkError as error:
            raise self._not_a_pmac(str(error.problems[0].value)) from error
        if not _VERSION.match(version):
            raise self._not_a_pmac(version)
        return version, kind

    def request(self, line: str, timeout_s: float = REPLY_TIMEOUT_S) -> tuple[str, ...]:
        """Send one line and return the data of its reply.

        Raises:
            ControllerError: the controller refused it.
            LinkTimeoutError: no complete reply in time; what the line did is unknown.
            LinkError: the link broke or is out of step.
        """
        self.send(line)
        return self.reply(line, timeout_s)

    def send(self, line: str) -> None:
        """Send one line without waiting; `reply` must follow, one line is in flight at a time.

        Raises:
            ControllerError: `controller.line_too_long`, nothing was sent.
            LinkError: the link broke.
        """
        data = line.encode("latin-1")
        if len(data) > LINE_LIMIT or b"\r" in data:
            raise ControllerError(
                Problem(code="controller.line_too_long", where=self.link.address, value=line[:40])
            )
        self.link.send(data + b"\r")

    def reply(self, line: str, timeout_s: float = REPLY_TIMEOUT_S) -> tuple[str, ...]:
        """Return the data of the reply to `line`, which was sent before.

        Raises:
            ControllerError: the controller refused it.
            LinkTimeoutError: no complete reply in time; what the line did is unknown.
            LinkError: the link broke or is out of step.
        """
        reply = self._reply(line, timeout_s)
        if reply.error_number is not None:
            raise ControllerError(
                Problem(code=f"controller.err{reply.error_number:03d}", where=self.link.address, value=line),
                error_number=reply.error_number,
            )
        return reply.lines

    def query(self, *items: str, timeout_s: float = REPLY_TIMEOUT_S) -> tuple[str, ...]:
        """Ask for several values in one line; return exactly one text for each.

        Raises:
            LinkError: `link.out_of_step`, the reply has another number of lines.
        """
        line = " ".join(items)
        values = self.request(line, timeout_s)
        if len(values) != len(items):
            raise LinkError(
                Problem(
                    code="link.out_of_step",
                    where=self.link.address,
                    key=line,
                    value=str(len(values)),
                    limit=str(len(items)),
                )
            )
        return values

    def numbers(self, *items: str) -> tuple[float, ...]:
        """Ask for numbers.

        Raises:
            LinkError: `link.out_of_step`, a value is no number.
        """
        values = self.query(*items)
        try:
            return tuple(float(value) for value in values)
        except ValueError as error:
            raise LinkError(Problem(code="link.out_of_step", where=self.link.address, value=str(error))) from error

    def download(self, lines: Iterable[str]) -> None:
        """Send program lines one by one; the first refusal ends it, with the buffer closed again.

        Raises:
            ControllerError: with the line that was refused.
        """
        try:
            for line in lines:
                self.request(line)
        except ControllerError:
            self.request("CLOSE")
            raise

    def _not_a_pmac(self, met: str) -> LinkError:
        return LinkError(Problem(code="link.not_a_pmac", where=self.link.address, value=met[:40]))

    def _reply(self, line: str, timeout_s: float) -> Reply:
        deadline = self._clock.now_s() + timeout_s
        while True:
            try:
                reply, used = take_reply(self._buffer)
            except FramingError as error:
                self._buffer = b""
                self.link.send(FLUSH)
                self._drain()
                raise LinkError(
                    Problem(code="link.out_of_step", where=self.link.address, key=line, value=str(error))
                ) from error
            if reply is not None:
                self._buffer = self._buffer[used:]
                return reply
            left = deadline - self._clock.now_s()
            if left <= 0.0:
                self.link.send(FLUSH)
                self._drain()
                raise LinkTimeoutError(
                    Problem(code="link.silent", where=self.link.address, key=line, value=f"{timeout_s:g} s")
                )
            self._buffer += self.link.receive(left)

    def _drain(self) -> None:
        """Read until the line has been quiet, and forget what came."""
        deadline = self._clock.now_s() + DRAIN_LIMIT_S
        while self.link.receive(QUIET_S) and self._clock.now_s() < deadline:
            pass
        self._buffer = b""
