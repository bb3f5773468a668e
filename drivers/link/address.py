"""Link addresses as an operator writes them: `tcp:HOST:PORT`."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.errors import LinkError
from profiles.problem import Problem

HIGHEST_PORT = 65_535


@dataclass(frozen=True, slots=True, kw_only=True)
class TcpAddress:
    """Host name or address, and port; port 0 lets a listener choose."""

    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp:{host}:{self.port}"


def parse_host_port(text: str) -> TcpAddress:
    """Read `HOST:PORT`, with brackets round an IPv6 address.

    Raises:
        LinkError: `link.bad_address`, the text is nothing of the kind.
    """
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]") if host.startswith("[") else host
    digits = port.isascii() and port.isdigit()
    if not colon or not host or not digits or int(port) > HIGHEST_PORT or " " in host:
        raise LinkError(
            Problem(code="link.bad_address", value=text, limit=f"HOST:PORT, 0 <= PORT <= {HIGHEST_PORT}")
        )
    return TcpAddress(host=host, port=int(port))


def parse_address(text: str) -> TcpAddress:
    """Read a link address.

    Raises:
        LinkError: `link.bad_address`.
    """
    kind, _, rest = text.partition(":")
    if kind != "tcp":
        raise LinkError(Problem(code="link.bad_address", value=text, limit="tcp:HOST:PORT"))
    return parse_host_port(rest)
