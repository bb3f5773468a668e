"""The instructor's end: one connection, on which each order gets its answer."""

from __future__ import annotations

from console.school.instructing.dispatcher import ANSWER_S
from console.school.instructing.order import OrderReply, read_answer
from console.school.instructing.server import ONCE, STAYS
from console.session.errors import SessionError
from drivers.errors import LinkError
from drivers.simulator.hosts.control_address import ControlAddress, connect_control, unreachable
from profiles.problem import Problem

TIMEOUT_S = ANSWER_S + 5.0  # the console says itself that it has no answer
CHUNK, MOST_BYTES = 65_536, 10_000_000


class Instructor:
    """A connection to a trainee's console; a context manager."""

    def __init__(self, address: ControlAddress, token: str, *, stays: bool) -> None:
        """Connect, and show the token.

        Raises:
            LinkError: a code for each way in which nobody answers.
            SessionError: `instruct.token`, it is wrong.
        """
        self._address, self._kept = address, b""
        try:
            self._link = connect_control(address, TIMEOUT_S)
        except OSError as error:
            raise unreachable(address, error) from error
        try:
            problem = self.ask(f"{STAYS if stays else ONCE} {token}").problem
            if problem is not None:
                raise SessionError(problem)
        except BaseException:
            self._link.close()
            raise

    def __enter__(self) -> Instructor:
        return self

    def __exit__(self, *_: object) -> None:
        self._link.close()

    def ask(self, line: str) -> OrderReply:
        """Send a line; return its answer. Raises LinkError as `__init__`."""
        try:
            self._link.sendall(line.encode("utf-8", "replace") + b"\n")
            return read_answer(self._line())
        except OSError as error:
            raise unreachable(self._address, error) from error
        except ValueError as error:
            raise LinkError(Problem(code="link.lost", where=str(self._address), value=str(error))) from error

    def _line(self) -> bytes:
        while b"\n" not in self._kept:
            data = self._link.recv(CHUNK)
            if not data or len(self._kept) > MOST_BYTES:
                raise ConnectionError("EOF")
            self._kept += data
        line, _, self._kept = self._kept.partition(b"\n")
        return line
