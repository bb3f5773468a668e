"""Link addresses as an operator writes them: `tcp:HOST:PORT`, `serial:/dev/NAME` or `serial:/dev/NAME:BAUD`."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.errors import LinkError
from profiles.problem import Problem

HIGHEST_PORT = 65_535
DEFAULT_BAUD_RATE = 38_400
HIGHEST_BAUD_RATE = 4_000_000

_SERIAL_FORM = f"serial:/dev/NAME[:BAUD], 1 <= BAUD <= {HIGHEST_BAUD_RATE}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TcpAddress:
    """Host name or address, and port; port 0 lets a listener choose."""

    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"tcp:{host}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialAddress:
    """The device file of a serial line, and its speed in bit/s."""

    device: str
    baud_rate: int = DEFAULT_BAUD_RATE

    def __str__(self) -> str:
        # A device whose own name has a colon would be cut there when it is read back.
        plain = self.baud_rate == DEFAULT_BAUD_RATE and ":" not in self.device
        return f"serial:{self.device}" if plain else f"serial:{self.device}:{self.baud_rate}"


def parse_host_port(text: str) -> TcpAddress:
    """Read `HOST:PORT`, with brackets round an IPv6 address.

    Raises:
        LinkError: `link.bad_address`, the text is nothing of the kind.
    """
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]") if host.startswith("[") else host
    digits = port.isascii() and port.isdigit() and len(port) <= len(str(HIGHEST_PORT))
    if not colon or not host or not digits or int(port) > HIGHEST_PORT or " " in host:
        raise LinkError(
            Problem(code="link.bad_address", value=text, limit=f"HOST:PORT, 0 <= PORT <= {HIGHEST_PORT}")
        )
    return TcpAddress(host=host, port=int(port))


def parse_device(text: str) -> SerialAddress:
    """Read `/dev/NAME` or `/dev/NAME:BAUD`; names by bus position have colons of their own.

    Raises:
        LinkError: `link.bad_address`, the text is nothing of the kind.
    """
    device, colon, rate = text.rpartition(":")
    if not colon or not (rate.isascii() and rate.isdigit()):
        device, rate = text, str(DEFAULT_BAUD_RATE)
    whole = device.startswith("/") and not device.endswith(("/", ":")) and device.isprintable()
    # The length first: a number of thousands of digits cannot be read.
    long = len(rate) > len(str(HIGHEST_BAUD_RATE))
    if not whole or " " in device or long or not 1 <= int(rate) <= HIGHEST_BAUD_RATE:
        raise LinkError(Problem(code="link.bad_address", value=text, limit=_SERIAL_FORM))
    return SerialAddress(device=device, baud_rate=int(rate))


def parse_address(text: str) -> TcpAddress | SerialAddress:
    """Read a link address.

    Raises:
        LinkError: `link.bad_address`.
    """
    kind, _, rest = text.partition(":")
    if kind == "tcp":
        return parse_host_port(rest)
    if kind == "serial":
        return parse_device(rest)
    raise LinkError(Problem(code="link.bad_address", value=text, limit=f"tcp:HOST:PORT | {_SERIAL_FORM}"))
