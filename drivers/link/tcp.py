"""A link over TCP that carries the controller's ASCII stream unchanged."""

from __future__ import annotations

from drivers.link.address import TcpAddress
from drivers.link.base import StopWay
from drivers.link.connection import Connection

SEND_TIMEOUT_S = 2.0
URGENT_WAIT_S = 0.02
"""How long a stop waits for room on a full connection."""


class TcpLink:
    """One connection. A control character also acts in the middle of a line: nothing delays a stop."""

    stop_way = StopWay.DIRECT
    checks_bytes = False
    """A terminal server continues on a serial line, where the bytes have no checksum."""

    def __init__(self, address: TcpAddress) -> None:
        """Connect.

        Raises:
            LinkError: `link.unknown_host`, `link.refused`, `link.no_answer`, `link.unreachable`, `link.failed`.
        """
        self.address = str(address)
        self._connection = Connection(address.host, address.port, self.address)

    def send(self, data: bytes) -> None:
        """Send bytes in order.

        Raises:
            LinkError: `link.lost`; also when nothing is accepted for `SEND_TIMEOUT_S`.
        """
        self._connection.write(data, SEND_TIMEOUT_S)

    def send_urgent(self, data: bytes) -> None:
        """Send now, before whatever still waits in `send`.

        Raises:
            LinkError: `link.lost`; also when it is not accepted within `URGENT_WAIT_S`.
        """
        self._connection.write(data, URGENT_WAIT_S)

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received within `timeout_s`.

        Raises:
            LinkError: `link.lost`, or `link.closed` by the controller.
        """
        return self._connection.read(timeout_s)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()
