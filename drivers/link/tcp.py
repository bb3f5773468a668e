"""A link over TCP that carries the controller's ASCII stream unchanged."""

from __future__ import annotations

from drivers.link.address import TcpAddress
from drivers.link.base import StopWay
from drivers.link.connection import Connection

SEND_TIMEOUT_S = 2.0
URGENT_WAIT_S = 0.02  # how long a stop waits for room on a full connection


class TcpLink(Connection):
    """One connection. A control character also acts in the middle of a line: nothing delays a stop."""

    stop_way = StopWay.DIRECT
    checks_bytes = False
    """A terminal server continues on a serial line, where the bytes have no checksum."""

    def __init__(self, address: TcpAddress) -> None:
        """Connect; errors as for `Connection`."""
        super().__init__(address.host, address.port, str(address))

    def send(self, data: bytes) -> None:
        """Send bytes in order; lost when nothing is accepted for `SEND_TIMEOUT_S`."""
        self.write(data, SEND_TIMEOUT_S)

    def send_urgent(self, data: bytes) -> None:
        """Send now, before whatever still waits in `send`; lost when not accepted within `URGENT_WAIT_S`."""
        self.write(data, URGENT_WAIT_S)
