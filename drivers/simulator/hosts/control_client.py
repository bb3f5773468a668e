"""The other end of a control socket: connect to one, and say in a problem why that fails."""

from __future__ import annotations

import socket

from drivers.errors import LinkError
from drivers.link.address import TcpAddress
from drivers.simulator.hosts.control_address import ControlAddress
from profiles.problem import Problem

_CODES = {ConnectionRefusedError: "link.refused", TimeoutError: "link.no_answer", ConnectionError: "link.lost"}


def connected(address: ControlAddress, timeout_s: float) -> socket.socket:
    """Return a connected socket with this timeout for each operation. Raises OSError."""
    if isinstance(address, TcpAddress):
        return socket.create_connection((address.host, address.port), timeout=timeout_s)
    link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        link.settimeout(timeout_s)
        link.connect(address.path)
    except OSError:
        link.close()
        raise
    return link


def unreachable(address: ControlAddress, error: OSError) -> LinkError:
    """Return why nobody answers at an address: `link.refused`, `link.no_answer`, `link.lost`, `link.failed`."""
    code = next((code for kind, code in _CODES.items() if isinstance(error, kind)), "link.failed")
    return LinkError(Problem(code=code, where=str(address), value=error.strerror or str(error)))
