"""The thread that serves instructors: it knows neither the screen nor the machine, and holds up neither.

A client says in its first line whether it stays, and the token: `stay TOKEN` or `once TOKEN`. Then each line is an
order, and each answer a line of JSON. A pause that was made by a client which stays ends when that client is lost:
no trainee is left standing.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import TYPE_CHECKING

from console.school.instructing.dispatcher import Dispatcher
from console.school.instructing.order import (
    LONGEST_LINE,
    InstructorOrder,
    OrderKind,
    OrderReply,
    encode_answer,
    read_order,
)
from console.school.instructing.token import is_token
from console.session.bounded_server import GONE, BoundedServer, send
from console.session.errors import SessionError
from drivers.simulator.hosts.control_socket import listen_for_control
from profiles.problem import Problem

if TYPE_CHECKING:
    from drivers.simulator.hosts.control_address import ControlAddress

MOST_CLIENTS = 8
HELLO_S = 5.0  # timeout for the token
WRONG_S = 0.5  # time that a wrong token costs
UNREAD_S = 5.0  # timeout for a client that does not read its answer
BETWEEN_S = 0.02  # shortest time between two orders of one client
UNREAD_BYTES = 65_536
STAYS, ONCE = "stay", "once"


class InstructorServer:
    """Listens from `start` to `close`."""

    def __init__(self, address: ControlAddress, token: str, dispatcher: Dispatcher) -> None:
        self._address, self._token, self._dispatcher = address, token, dispatcher
        self._server = BoundedServer(
            "instructor",
            lambda made, opened: listen_for_control(made, address, opened),
            self._converse,
            most_clients=MOST_CLIENTS,
            longest_line=LONGEST_LINE,
            unread_bytes=UNREAD_BYTES,
        )

    def start(self) -> str:
        """Listen; return the address that was bound. Raises LinkError: `link.cannot_listen`."""
        return self._server.start(self._address)

    def close(self) -> None:
        """Stop listening, and drop everybody; returns soon, whatever they do."""
        self._server.close()

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = _Client(self._dispatcher, reader, writer)
        with suppress(*GONE):
            if await client.is_let_in(self._token):
                await client.serve()
        writer.transport.abort()
        await client.leave()


class _Client:
    """One client."""

    def __init__(self, dispatcher: Dispatcher, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._dispatcher, self._reader, self._writer = dispatcher, reader, writer
        self._stays = self._paused = False

    async def is_let_in(self, token: str) -> bool:
        """Read the first line; return whether it has the token, and say so."""
        async with asyncio.timeout(HELLO_S):
            line = await self._reader.readline()
        how, _, given = line.decode("utf-8", "replace").strip().partition(" ")
        if how in (STAYS, ONCE) and is_token(given, token):
            self._stays = how == STAYS
            await self._say(OrderReply())
            return True
        await asyncio.sleep(WRONG_S)
        await self._say(OrderReply(problem=Problem(code="instruct.token")))
        self._writer.close()
        with suppress(OSError):
            async with asyncio.timeout(UNREAD_S):
                await self._writer.wait_closed()
        return False

    async def serve(self) -> None:
        """Answer one order after the other."""
        while line := await self._reader.readline():
            await self._say(await self._answer_line(line.decode("utf-8", "replace").rstrip("\r\n")))
            await asyncio.sleep(BETWEEN_S)

    async def leave(self) -> None:
        """End a pause that this client has made: it stays no longer."""
        if self._stays and self._paused:
            await self._dispatcher.carry(InstructorOrder(do=OrderKind.RESUME, line=OrderKind.RESUME.value))

    async def _answer_line(self, line: str) -> OrderReply:
        try:
            order = read_order(line)
        except SessionError as error:
            return OrderReply(problem=error.problems[0])
        answer = await self._dispatcher.carry(order)
        if answer.problem is None:
            self._paused = order.do is OrderKind.PAUSE or (
                self._paused and order.do not in (OrderKind.RESUME, OrderKind.RETURN)
            )
        return answer

    async def _say(self, answer: OrderReply) -> None:
        await send(self._writer, encode_answer(answer), UNREAD_S)
