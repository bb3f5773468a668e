"""The address of the control socket: `tcp:HOST:PORT` of this machine, or `unix:PATH` in its file system."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from ipaddress import ip_address
from typing import TypeAlias

from drivers.errors import LinkError
from drivers.link.address import TcpAddress, parse_host_port
from profiles.problem import Problem

PREFIX = "control:"  # prefix of such an address in a list of addresses
OK, REFUSED = "ok", "refused: "  # first word of the last line of each reply
LONGEST_PATH = 107  # maximum bytes of a socket path: one less than Linux has room for
LONGEST_LINE = 4096  # maximum bytes of a line, without its end
_FORM = f"tcp:127.0.0.1:PORT | unix:PATH, a path of {LONGEST_PATH} bytes at most"


@dataclass(frozen=True, slots=True, kw_only=True)
class UnixAddress:
    """A socket in the file system."""

    path: str

    def __str__(self) -> str:
        return f"unix:{self.path}"


ControlAddress: TypeAlias = TcpAddress | UnixAddress


def parse_control_address(text: str) -> ControlAddress:
    """Parse an address, with or without the prefix `control:`.

    Raises LinkError: `link.bad_address`; `link.not_loopback`, it is on another machine, or reachable from one.
    """
    kind, _, rest = text.removeprefix(PREFIX).partition(":")
    if kind == "tcp":
        address = parse_host_port(rest)
        if not is_loopback(address.host):
            raise LinkError(
                Problem(code="link.not_loopback", value=address.host, limit="127.0.0.1, ::1, localhost")
            )
        return address
    if kind != "unix" or not rest or not rest.isprintable() or len(rest.encode()) > LONGEST_PATH:
        raise LinkError(Problem(code="link.bad_address", value=text, limit=_FORM))
    return UnixAddress(path=rest)


def is_loopback(host: str) -> bool:
    """Whether only this computer reaches an address."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


_CODES = {ConnectionRefusedError: "link.refused", TimeoutError: "link.no_answer", ConnectionError: "link.lost"}


def connect_control(address: ControlAddress, timeout_s: float) -> socket.socket:
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
