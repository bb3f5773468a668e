"""Parse link addresses as an operator writes them; `str` of an address gives the shortest equivalent text.

`serial:/dev/NAME[?baud=RATE]`, `tcp:HOST:PORT`, `ethernet:HOST[:PORT][?stop=reserved]`, and `sim:` for the
simulated lathe. What cannot be parsed raises LinkError: `link.bad_address`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.errors import LinkError
from drivers.lathe_placement import LathePlacement
from profiles.problem import Problem

HIGHEST_PORT = 65_535
ETHERNET_PORT = 1025  # default port of the controllers' Ethernet boards
DEFAULT_BAUD_RATE = 38_400
HIGHEST_BAUD_RATE = 4_000_000

_SERIAL_FORM = f"serial:/dev/NAME[?baud=RATE], 1 <= RATE <= {HIGHEST_BAUD_RATE}"
_HOST_FORM = f"HOST:PORT, 0 <= PORT <= {HIGHEST_PORT}"
_TCP_FORM = f"tcp:HOST:PORT, 1 <= PORT <= {HIGHEST_PORT}"
_ETHERNET_FORM = f"ethernet:HOST[:PORT][?stop=reserved], 1 <= PORT <= {HIGHEST_PORT}"
_FORMS = f"serial:/dev/NAME[?baud=RATE] | tcp:HOST:PORT | ethernet:HOST[:{ETHERNET_PORT}][?stop=reserved] | sim:"

_RESERVED = "?stop=reserved"
_RATE_AFTER_COLON = re.compile(r".*:[0-9]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class TcpAddress:
    """A plain character stream to a host name or number and a port; with port 0 a listener chooses its own."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp:{_bracket_host(self.host)}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class EthernetAddress:
    """The Ethernet board of a controller; `reserves_stop` opens a second connection for stops alone."""

    host: str
    port: int = ETHERNET_PORT
    reserves_stop: bool = False

    def __str__(self) -> str:
        port = "" if self.port == ETHERNET_PORT else f":{self.port}"
        return f"ethernet:{_bracket_host(self.host)}{port}{_RESERVED if self.reserves_stop else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialAddress:
    """The device file of a serial line, and its speed in bit/s."""

    device: str
    baud_rate: int = DEFAULT_BAUD_RATE

    def __str__(self) -> str:
        # A device name of this kind needs a rate: without one, its own colon part could be read as a rate.
        plain = self.baud_rate == DEFAULT_BAUD_RATE and not _needs_rate(self.device)
        return f"serial:{self.device}" if plain else f"serial:{self.device}?baud={self.baud_rate}"


@dataclass(frozen=True, slots=True)
class SimulatedAddress:
    """The simulated lathe of the machine profile, in this process.

    Set up by hand, with the simulated hardware of `plant` (a name or a file). Random effects use `seed`, and the
    chucking force varies from clamping to clamping with a standard deviation of `clamping_sd_percent`, of the
    plant's own with None. A `blind` one shows dials instead of the truth. It begins at power-up, or `placed`. One
    that `goes_on` has its next part, after those that the record has of this plant and seed; else its first.
    """

    plant: str = "realistic"
    seed: int | None = None
    clamping_sd_percent: float | None = None
    blind: bool = False
    placed: LathePlacement | None = None
    goes_on: bool = False

    def __str__(self) -> str:
        return "sim:"


WiredAddress = TcpAddress | EthernetAddress | SerialAddress  # can be connected to
LinkAddress = WiredAddress | SimulatedAddress


def without_options(address: str) -> str:
    """Return the address without its option for a reserved stop connection."""
    return address.removesuffix(_RESERVED)


def parse_address(text: str) -> LinkAddress:
    """Parse a link address."""
    kind, _, rest = text.partition(":")
    match kind:
        case "serial":
            return parse_device(rest)
        case "tcp":
            host, port = _host_and_port(rest, text, _TCP_FORM)
            return TcpAddress(host=host, port=port)
        case "ethernet":
            place = rest.removesuffix(_RESERVED)
            if ":" not in place.rpartition("]")[2]:
                place = f"{place}:{ETHERNET_PORT}"
            host, port = _host_and_port(place, text, _ETHERNET_FORM)
            return EthernetAddress(host=host, port=port, reserves_stop=rest.endswith(_RESERVED))
        case "sim" if text == "sim:":
            return SimulatedAddress()
    raise _bad_address(text, _FORMS)


def parse_host_port(text: str) -> TcpAddress:
    """Parse `HOST:PORT` of a listener, with brackets round an IPv6 address; port 0 lets it choose."""
    host, port = _host_and_port(text, text, _HOST_FORM, lowest_port=0)
    return TcpAddress(host=host, port=port)


def parse_device(text: str) -> SerialAddress:
    """Parse `/dev/NAME` or `/dev/NAME?baud=RATE`, not `/dev/NAME:RATE`: names by bus position contain colons."""
    device, asked, query = text.rpartition("?")
    name, _, rate = query.partition("=") if asked else ("baud", "=", str(DEFAULT_BAUD_RATE))
    device = device if asked else text
    whole = device.startswith("/") and not device.endswith(("/", ":")) and device.isprintable()
    bare_rate = not asked and _needs_rate(device)
    if not whole or " " in device or bare_rate or name != "baud" or not _is_within(rate, 1, HIGHEST_BAUD_RATE):
        raise _bad_address(f"serial:{text}", _SERIAL_FORM)
    return SerialAddress(device=device, baud_rate=int(rate))


def _needs_rate(device: str) -> bool:
    return "?" in device or _RATE_AFTER_COLON.fullmatch(device) is not None


def _host_and_port(text: str, whole: str, form: str, lowest_port: int = 1) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    bracketed = host.startswith("[") and host.endswith("]")
    host = host[1:-1] if bracketed else host
    # Without brackets the port of an IPv6 address cannot be told from its last group.
    readable = host and not (":" in host and not bracketed) and not re.search(r"[\s\[\]/?]", host)
    if not colon or not readable or not host.isprintable() or not _is_within(port, lowest_port, HIGHEST_PORT):
        raise _bad_address(whole, form)
    return host, int(port)


def _is_within(digits: str, lowest: int, highest: int) -> bool:
    # Check the length first: int() refuses numbers of thousands of digits.
    short = 0 < len(digits) <= len(str(highest)) and digits.isascii() and digits.isdigit()
    return short and lowest <= int(digits) <= highest


def _bracket_host(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _bad_address(text: str, form: str) -> LinkError:
    return LinkError(Problem(code="link.bad_address", value=text, limit=form))
