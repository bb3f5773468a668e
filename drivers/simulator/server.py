"""The simulated card on a TCP port: an ASCII stream for any number of hosts, in real time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from drivers.errors import LinkError
from drivers.link.address import TcpAddress
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.port import Port
from drivers.simulator.real_time import UNREAD_LIMIT, ending_signals, keep_time
from profiles.problem import Problem


class _Host(asyncio.Protocol):
    """One connected host."""

    def __init__(self, lathe: SimulatedLathe, hosts: set[_Host]) -> None:
        self._lathe = lathe
        self._hosts = hosts
        self._port: Port | None = None
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._port = self._lathe.connect()
        self._hosts.add(self)

    def data_received(self, data: bytes) -> None:
        if self._port is not None:
            self._port.receive(data)
            self._hold_back()

    def connection_lost(self, exc: Exception | None) -> None:
        self._hosts.discard(self)
        if self._port is not None:
            self._lathe.disconnect(self._port)
            self._port = None

    def flush(self) -> None:
        """Send what the card has answered, and read on when it has room again."""
        if self._port is None or self._transport is None:
            return
        self._hold_back()
        data = self._port.take_output()
        if data:
            self._transport.write(data)
        if self._transport.get_write_buffer_size() > UNREAD_LIMIT:
            self._transport.abort()

    def _hold_back(self) -> None:
        """Leave to the network what the card has no room for."""
        if self._port is None or self._transport is None:
            return
        if not self._port.crowded:
            self._transport.resume_reading()
        elif self._transport.is_reading():
            self._transport.pause_reading()


def serve(lathe: SimulatedLathe, address: TcpAddress, ready: Callable[[TcpAddress], None]) -> None:
    """Serve until SIGINT, SIGTERM or SIGHUP. `ready` is told the address that is listened on.

    Raises:
        LinkError: `link.cannot_listen`.
    """
    asyncio.run(_serve(lathe, address, ready))


async def _serve(lathe: SimulatedLathe, address: TcpAddress, ready: Callable[[TcpAddress], None]) -> None:
    loop, ended = asyncio.get_running_loop(), ending_signals()
    hosts: set[_Host] = set()
    try:
        server = await loop.create_server(lambda: _Host(lathe, hosts), address.host, address.port)
    except OSError as error:
        reason = error.strerror or str(error)
        raise LinkError(Problem(code="link.cannot_listen", where=str(address), value=reason)) from error
    host, port = server.sockets[0].getsockname()[:2]
    ready(TcpAddress(host=host, port=port))
    await keep_time(lathe, hosts, ended.wait())
    server.close()
    for connected in tuple(hosts):
        connected.flush()
