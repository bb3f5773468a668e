"""The server of SHDR lines: any number of agents up to a bound, each told what has changed since its last line.

An agent that pings has to go on doing so. Who does not read is dropped once the few lines have filled up that the
system keeps for it.
"""

from __future__ import annotations

import asyncio
import socket

from console.session.bounded_server import BoundedServer, abandon, send
from console.site.exchange.conditions import NORMAL, TYPES, Condition
from console.site.exchange.data_items import UNAVAILABLE, Published
from drivers.link.address import TcpAddress
from drivers.simulator.hosts.control_socket import listen_for_control

MOST_CLIENTS = 16
LONGEST_LINE = 1000  # bytes; agents send pings only
KEPT_BYTES = 8192  # that the system keeps for a client: some lines
UNREAD_S = 5.0  # timeout for a client that does not read
HEARTBEAT_S = 10.0  # between two pings of an agent; it is dropped after twice that
LOOK_S = 0.1  # between two looks at what is new
PING = b"* PING"


def pong_line(heartbeat_s: float) -> str:
    """Return the answer to a ping: how often the agent has to send one."""
    return f"* PONG {round(heartbeat_s * 1000)}"


def shdr_lines(now: Published, before: Published | None) -> list[str]:
    """Return the lines that take an agent from what it was told `before` to `now`; None: nothing yet."""
    told = {} if before is None else before.values
    changed = {key: value for key, value in now.values.items() if told.get(key) != value}
    pairs = [field for key, value in changed.items() for field in (key, value)]
    lines = [_line(now.at_utc, *pairs)] if pairs else []
    for key in TYPES:
        lines += _of_condition(key, now, before)
    return lines


def _of_condition(key: str, now: Published, before: Published | None) -> list[str]:
    """Return the lines of a condition. NORMAL without a code clears all of them, with a code that one."""
    if now.conditions is None:
        known = before is not None and before.conditions is None
        return [] if known else [_line(now.at_utc, key, UNAVAILABLE, "", "", "", "")]
    active = now.conditions[key]
    if before is None or before.conditions is None:
        anew = [_line(now.at_utc, key, NORMAL, "", "", "", "")]
        return anew + [_active_line(now.at_utc, key, each) for each in active]
    were, codes = before.conditions[key], {each.code for each in active}
    if were and not active:
        return [_line(now.at_utc, key, NORMAL, "", "", "", "")]
    ended = [_line(now.at_utc, key, NORMAL, each.code, "", "", "") for each in were if each.code not in codes]
    return ended + [_active_line(now.at_utc, key, each) for each in active if each not in were]


def _active_line(at_utc: str, key: str, each: Condition) -> str:
    return _line(at_utc, key, each.level, each.code, each.priority, "", each.text)


def _line(*fields: str) -> str:
    return "|".join(_field(each) for each in fields)


def _field(value: str) -> str:
    """Return a value as a field: on one line, and quoted where it could be taken for more than one field."""
    value = " ".join(value.split())
    if "|" not in value and not value.startswith('"'):
        return value
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("|", "\\|")
    return f'"{escaped}"'


class Adapter:
    """Serves what was given to `show` last."""

    def __init__(self, host: str, port: int, heartbeat_s: float = HEARTBEAT_S, unread_s: float = UNREAD_S) -> None:
        self._address = TcpAddress(host=host, port=port)
        self._heartbeat_s, self._unread_s = heartbeat_s, unread_s
        self._newest: Published | None = None
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

    def show(self, published: Published) -> None:
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
        told: Published | None = None
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
                        await self._say(writer, [pong_line(self._heartbeat_s)])
                    asked = asyncio.create_task(reader.readline())
        finally:
            abandon(asked)

    async def _say(self, writer: asyncio.StreamWriter, lines: list[str]) -> None:
        if lines:
            data = "".join(f"{line}\n" for line in lines).encode("utf-8", "replace")
            await send(writer, data, self._unread_s)
