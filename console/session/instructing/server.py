"""The thread that serves instructors: it knows neither the screen nor the machine, and holds up neither.

A client says in its first line whether it stays, and the token: `stay TOKEN` or `once TOKEN`. Then each line is an
order, and each answer a line of JSON. A pause that was made by a client which stays ends when that client is lost:
no trainee is left standing.
"""

from __future__ import annotations

import asyncio
import threading
from contextlib import ExitStack, suppress
from queue import SimpleQueue
from typing import TYPE_CHECKING

from console.session.errors import SessionError
from console.session.instructing.answer import Answer, written
from console.session.instructing.clerk import Clerk
from console.session.instructing.order import LONGEST_LINE, Do, Order, read_order
from console.session.instructing.token import is_token
from drivers.errors import LinkError
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
START_S, END_S = 5.0, 2.0


class InstructorServer:
    """Listens from `start` to `close`."""

    def __init__(self, address: ControlAddress, token: str, clerk: Clerk) -> None:
        self._address, self._token, self._clerk = address, token, clerk
        self._started: SimpleQueue[str | OSError] = SimpleQueue()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ended: asyncio.Event | None = None
        self._clients = 0
        self._thread = threading.Thread(target=self._run, name="instructor", daemon=True)

    def start(self) -> str:
        """Listen; return the address that was bound. Raises LinkError: `link.cannot_listen`."""
        self._thread.start()
        came = self._started.get(timeout=START_S)
        if isinstance(came, OSError):
            value = came.strerror or str(came)
            raise LinkError(Problem(code="link.cannot_listen", where=str(self._address), value=value)) from came
        return came

    def close(self) -> None:
        """Stop listening, and drop everybody; returns soon, whatever they do."""
        if self._loop is not None and self._ended is not None:
            with suppress(RuntimeError):  # its loop has ended
                self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(END_S)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        with ExitStack() as opened:
            try:
                bound = await listen_for_control(self._made, self._address, opened)
            except OSError as error:
                self._started.put(error)
                return
            self._started.put(bound)
            await self._ended.wait()

    def _made(self) -> asyncio.Protocol:
        reader = asyncio.StreamReader(limit=LONGEST_LINE + 1)
        return asyncio.StreamReaderProtocol(reader, self._converse)

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one client until it leaves, or does what no instructor does."""
        self._clients += 1
        visit = _Visit(self._clerk, reader, writer)
        try:
            if self._clients <= MOST_CLIENTS and await visit.is_let_in(self._token):
                await visit.serve()
        except (OSError, ValueError, asyncio.IncompleteReadError, TimeoutError):
            pass  # gone, a line without an end, or too slow: there is nobody to tell
        finally:
            self._clients -= 1
            writer.transport.abort()
        await visit.leave()


class _Visit:
    """One client."""

    def __init__(self, clerk: Clerk, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clerk, self._reader, self._writer = clerk, reader, writer
        self._stays = self._paused = False
        writer.transport.set_write_buffer_limits(high=UNREAD_BYTES)

    async def is_let_in(self, token: str) -> bool:
        """Read the first line; return whether it has the token, and say so."""
        line = await asyncio.wait_for(self._reader.readline(), HELLO_S)
        how, _, given = line.decode("utf-8", "replace").strip().partition(" ")
        if how in (STAYS, ONCE) and is_token(given, token):
            self._stays = how == STAYS
            await self._say(Answer())
            return True
        await asyncio.sleep(WRONG_S)
        await self._say(Answer(problem=Problem(code="instruct.token")))
        self._writer.close()
        with suppress(OSError):
            await asyncio.wait_for(self._writer.wait_closed(), UNREAD_S)
        return False

    async def serve(self) -> None:
        """Answer one order after the other."""
        while line := await self._reader.readline():
            await self._say(await self._answered(line.decode("utf-8", "replace").rstrip("\r\n")))
            await asyncio.sleep(BETWEEN_S)

    async def leave(self) -> None:
        """End a pause that this client has made: it stays no longer."""
        if self._stays and self._paused:
            await self._clerk.carry(Order(do=Do.RESUME, line=Do.RESUME.value))

    async def _answered(self, line: str) -> Answer:
        try:
            order = read_order(line)
        except SessionError as error:
            return Answer(problem=error.problems[0])
        answer = await self._clerk.carry(order)
        if answer.problem is None:
            self._paused = order.do is Do.PAUSE or (self._paused and order.do not in (Do.RESUME, Do.RETURN))
        return answer

    async def _say(self, answer: Answer) -> None:
        self._writer.write(written(answer))
        await asyncio.wait_for(self._writer.drain(), UNREAD_S)
