"""Serve the simulated controller in real time, at any number of addresses: ASCII, Ethernet boards, serial.

Faults have a control address of their own.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

from drivers.errors import LinkError
from drivers.link.address import SerialAddress, TcpAddress
from drivers.simulator.hosts.connection import HostConnection, PlainStream
from drivers.simulator.hosts.control_address import PREFIX, ControlAddress
from drivers.simulator.hosts.control_socket import ControlHost, listen_for_control
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.hosts.pty import PtyHost
from drivers.simulator.hosts.real_time import Host, SimulationPace, TerminationSignals, keep_time
from drivers.simulator.machine import SimulatedLathe
from profiles.problem import Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class Listeners:
    """Listening addresses: `tcp` for ASCII, `ethernet` for requests of the board, `control` for faults."""

    tcp: TcpAddress | None = None
    ethernet: TcpAddress | None = None
    pty: bool = False
    control: ControlAddress | None = None


def serve(
    lathe: SimulatedLathe, listeners: Listeners, ready: Callable[[str], None], speed: float = 1.0
) -> int | None:
    """Serve until SIGINT, SIGTERM or SIGHUP, and return which; simulated time is `speed` times as fast as real.

    Once all of them accept connections, `ready` is called with each address, such as `tcp:127.0.0.1:1025`.

    Raises LinkError: `link.cannot_listen`.
    """
    return asyncio.run(_serve(lathe, listeners, ready, speed))


async def _serve(
    lathe: SimulatedLathe, listeners: Listeners, ready: Callable[[str], None], speed: float
) -> int | None:
    ended = TerminationSignals()
    hosts: set[Host] = set()
    with ExitStack() as opened:
        addresses = [address async for address in listen(lathe, listeners, hosts, opened)]
        for address in addresses:
            ready(address)
        await keep_time(lathe.wait, hosts, ended.wait(), pace=SimulationPace(speed))
        for connected in tuple(hosts):
            connected.flush()
    return ended.number


async def listen(
    lathe: SimulatedLathe, listeners: Listeners, hosts: set[Host], opened: ExitStack
) -> AsyncIterator[str]:
    """Listen at all addresses; yield the bound addresses. `opened` closes them.

    Whatever advances the time of the lathe has to `flush` the `hosts` then.

    Raises LinkError: `link.cannot_listen`.
    """
    board = Board()
    if listeners.tcp:
        yield await _bind("tcp", listeners.tcp, lambda: HostConnection(lathe, hosts, PlainStream), opened)
    if listeners.ethernet:
        session = partial(EthernetSession, board=board)
        yield await _bind("ethernet", listeners.ethernet, lambda: HostConnection(lathe, hosts, session), opened)
    if listeners.pty:
        try:
            line = PtyHost(lathe)
        except OSError as error:
            raise _refusal("pty", error) from error
        opened.callback(line.close)
        hosts.add(line)
        yield str(SerialAddress(device=line.device))
    if listeners.control:
        try:
            _, bound = await listen_for_control(lambda: ControlHost(lathe), listeners.control, opened)
            yield bound
        except OSError as error:
            raise _refusal(f"{PREFIX}{listeners.control}", error) from error


async def _bind(kind: str, address: TcpAddress, connect: Callable[[], HostConnection], opened: ExitStack) -> str:
    try:
        server = await asyncio.get_running_loop().create_server(connect, address.host, address.port)
    except OSError as error:
        raise _refusal(_format_address(kind, address), error) from error
    opened.callback(server.close)
    host, port = server.sockets[0].getsockname()[:2]
    return _format_address(kind, TcpAddress(host=host, port=port))


def _format_address(kind: str, address: TcpAddress) -> str:
    return f"{kind}:{str(address).removeprefix('tcp:')}"


def _refusal(where: str, error: OSError) -> LinkError:
    reason = error.strerror or str(error)
    return LinkError(Problem(code="link.cannot_listen", where=where, value=reason))
