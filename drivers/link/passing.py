"""A link that passes everything on to another one: the base of those that hear, trace or replace it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

from drivers.errors import LinkError
from drivers.link.base import Link, StopWay
from profiles.problem import Problem


class PassingLink:
    """Passes everything on to `link`."""

    def __init__(self, link: Link) -> None:
        self.address = link.address
        self._link = link

    @property
    def checks_bytes(self) -> bool:
        """Whether bytes arrive intact or not at all."""
        return self._link.checks_bytes

    @property
    def stop_way(self) -> StopWay:
        """Return the route that a stop would take now."""
        return self._link.stop_way

    def send(self, data: bytes) -> None:
        """Send bytes in order."""
        self._link.send(data)

    def send_urgent(self, data: bytes) -> None:
        """Send a stop on the connection itself; then the links around it note it, and none of them can fail it."""
        around, link = [self], self._link
        while isinstance(link, PassingLink):
            around.append(link)
            link = link._link  # noqa: SLF001 - of the same class
        failure: LinkError | None = None
        try:
            link.send_urgent(data)
        except LinkError as error:
            failure = error
        for each in reversed(around):
            with suppress(Exception):
                each.note_urgent(data, failure)
        if failure is not None:
            raise failure

    def note_urgent(self, data: bytes, failure: LinkError | None) -> None:
        """Note a stop that was sent, or was not because of `failure`."""

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        return self._link.receive(timeout_s)

    def close(self) -> None:
        """Close the link."""
        self._link.close()


Tap = Callable[[str, bytes], object]
"""Takes a mark as in a trace (`>`, `<`, `!` a stop, `*` a failure) and bytes; returns at once, never raises."""


class TappedLink(PassingLink):
    """Passes everything on to `link` first, then to `tap`, perhaps from a signal handler."""

    def __init__(self, link: Link, tap: Tap) -> None:
        super().__init__(link)
        self._tap = tap

    def _tell(self, mark: str, data: bytes) -> None:
        with suppress(Exception):  # what cannot be recorded is still sent, received and obeyed
            self._tap(mark, data)

    def send(self, data: bytes) -> None:
        """Send bytes in order."""
        try:
            super().send(data)
        except LinkError as error:
            self._tell("*", error.problems[0].code.encode())
            raise
        self._tell(">", data)

    def note_urgent(self, data: bytes, failure: LinkError | None) -> None:
        """Tell the tap of a stop."""
        if failure is None:
            self._tell("!", data)
        else:
            self._tell("*", failure.problems[0].code.encode())

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received, waiting at most `timeout_s`."""
        try:
            data = super().receive(timeout_s)
        except LinkError as error:
            self._tell("*", error.problems[0].code.encode())
            raise
        if data:
            self._tell("<", data)
        return data


class RenewableLink(PassingLink):
    """Passes everything on to the present connection; between `drop` and `renew` there is none.

    What is sent meanwhile is refused (`link.lost`), never kept for later. `drop` and `renew` belong to the thread
    that sends and receives.
    """

    def drop(self, problem: Problem | None = None) -> None:
        """Close a lost connection: a serial line, or a board, may admit no second one beside it.

        Whatever is sent until `renew` is refused with the `problem`.
        """
        problem = problem or Problem(code="link.lost", where=self.address, value="not connected")
        before, self._link = self._link, _NoLink(self.address, self._link.checks_bytes, problem)
        before.close()

    def renew(self, link: Link) -> None:
        """Use this connection from now on."""
        self._link = link


class _NoLink:
    """The absence of a connection, for a reason that everything sent raises."""

    stop_way = StopWay.DIRECT

    def __init__(self, address: str, checks_bytes: bool, problem: Problem) -> None:
        self.address, self.checks_bytes, self._problem = address, checks_bytes, problem

    def send(self, data: bytes) -> None:
        self._refuse()

    def send_urgent(self, data: bytes) -> None:
        self._refuse()

    def receive(self, timeout_s: float) -> bytes:
        self._refuse()

    def close(self) -> None:
        """Do nothing."""

    def _refuse(self) -> NoReturn:
        raise LinkError(self._problem)
