"""The server of SHDR lines: any number of agents up to a bound, each told what has changed since its last line.

An agent that pings has to go on doing so. Who does not read is dropped once the few lines have filled up that the
system keeps for it.
"""

from __future__ import annotations

import asyncio
import socket

from console.session.bounded_server import BoundedServer, abandon, send
from console.site.exchange.mtconnect import PublishedState, shdr_lines
from drivers.link.address import TcpAddress
from drivers.simulator.hosts.control_socket import listen_for_control

MOST_CLIENTS = 16
LONGEST_LINE = 1000  # bytes; agents send pings only
KEPT_BYTES = 8192  # that the system keeps for a client: some lines
UNREAD_S = 5.0  # timeout for a client that does not read
HEARTBEAT_S = 10.0  # between two pings of an agent; it is dropped after twice that
LOOK_S = 0.1  # between two looks at what is new
PING = b"* PING"  # is answered by how often the agent has to send one, ms


class Adapter:
    """Serves what was given to `show` last."""

    def __init__(self, host: str, port: int, heartbeat_s: float = HEARTBEAT_S, unread_s: float = UNREAD_S) -> None:
        self._address = TcpAddress(host=host, port=port)
        self._heartbeat_s, self._unread_s = heartbeat_s, unread_s
        self._newest: PublishedState | None = None
        self._server = BoundedServer(
            "mtconnect",
            lambda made, opened: listen_for_control(made, self._address, opened),
            self._converse,
            most_clients=MOST_CLIENTS,
            longest_line=LONGEST_LINE,
            unread_bytes=0,
        )

    def start(self) -> str:
        """Listen; return the address that was bound, `HOST:PORT`. Raises LinkError: `link.cannot_listen`."""
        return self._server.start(self._address).partition(":tcp:")[2]

    def show(self, published: PublishedState) -> None:
        """Let every client have this moment; returns at once."""
        self._newest = published

    def close(self) -> None:
        """Drop everybody."""
        self._server.close()

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = writer.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, KEPT_BYTES)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        now_s = asyncio.get_running_loop().time
        told: PublishedState | None = None
        last_ping_s: float | None = None
        asked = asyncio.create_task(reader.readline())
        try:
            while last_ping_s is None or now_s() - last_ping_s < 2.0 * self._heartbeat_s:
                newest = self._newest
                if newest is not None and newest is not told:
                    await self._say(writer, shdr_lines(newest, told))
                    told = newest
                await asyncio.wait({asked}, timeout=LOOK_S)
                if asked.done():
                    line = asked.result()
                    if not line.endswith(b"\n"):
                        return  # it has left
                    if line.strip() == PING:
                        last_ping_s = now_s()
                        await self._say(writer, [f"* PONG {round(self._heartbeat_s * 1000)}"])
                    asked = asyncio.create_task(reader.readline())
        finally:
            abandon(asked)

    async def _say(self, writer: asyncio.StreamWriter, lines: list[str]) -> None:
        if lines:
            data = "".join(f"{line}\n" for line in lines).encode("utf-8", "replace")
            await send(writer, data, self._unread_s)
