"""Where the terminal of this console is, as far as the environment tells: at this computer, or at the end of SSH.

A console inside tmux has the environment of the tmux server, whoever has attached to it since; a port that was
forwarded looks like this computer. So nothing here proves that somebody stands at the machine.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping

from drivers.lathe.console_role import BY_SSH, MOST_OF_A_HOST

UNKNOWN = "?"


def remote_client(environment: Mapping[str, str]) -> str:
    """Return the address of the computer that SSH comes from, "?" where only SSH is known; "" at this computer."""
    told = (environment.get("SSH_CONNECTION") or environment.get("SSH_CLIENT") or "").split()
    if not told:
        return UNKNOWN if environment.get("SSH_TTY") else ""
    try:
        address = ipaddress.ip_address(told[0].partition("%")[0])
    except ValueError:
        return UNKNOWN
    mapped = getattr(address, "ipv4_mapped", None)
    if mapped is not None:
        address = mapped
    return "" if address.is_loopback else str(address)


def signed_host(client: str, host: str) -> str:
    """Return what a console signs as its computer: where SSH comes from, else `host`; long ones say SSH alone."""
    if not client:
        return host
    return client if client != UNKNOWN and len(client) <= MOST_OF_A_HOST else BY_SSH
