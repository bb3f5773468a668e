"""Opening whatever link an address names."""

from __future__ import annotations

from drivers.link.address import EthernetAddress, SerialAddress, TcpAddress, WiredAddress
from drivers.link.base import Link


def open_link(address: WiredAddress) -> Link:
    """Connect.

    Raises:
        LinkError: each way to fail with a code of its own, see `docs/links.md`.
    """
    # What is not connected to is not loaded.
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
