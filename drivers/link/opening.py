"""Open the link that an address names."""

from __future__ import annotations

from drivers.link.address import EthernetAddress, SerialAddress, TcpAddress, WiredAddress
from drivers.link.base import Link


def open_link(address: WiredAddress) -> Link:
    """Connect to the address. Raises LinkError: a code of its own for each failure, see `docs/links.md`."""
    # Import only the transport that is used.
    match address:
        case SerialAddress():
            from drivers.link.serial import SerialLink

            return SerialLink(address)
        case TcpAddress():
            from drivers.link.tcp import TcpLink

            return TcpLink(address)
        case EthernetAddress():
            from drivers.link.ethernet import EthernetLink

            return EthernetLink(address)
