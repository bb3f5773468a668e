"""One link for a whole session: the connection beneath it may be lost, and opened anew."""

from __future__ import annotations

from typing import NoReturn

from drivers.errors import LinkError
from drivers.link.base import Link, StopWay
from drivers.link.passing import PassingLink
from profiles.problem import Problem


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
