"""Open the link that an address names."""

from __future__ import annotations

from drivers.link.address import EthernetAddress, SerialAddress, TcpAddress, WiredAddress
from drivers.link.base import Link, StopWay
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


def open_link(address: WiredAddress) -> Link:
    """Connect to the address. Raises LinkError: a code of its own for each failure, see `docs/links.md`."""
    # Import only the transport that is used.
    match address:
        case SerialAddress():
            from drivers.link.serial import SerialLink

            return SerialLink(address)
        case TcpAddress():
            return TcpLink(address)
        case EthernetAddress():
            from drivers.link.ethernet import EthernetLink

            return EthernetLink(address)
