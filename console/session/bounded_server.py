"""A server for clients that nobody trusts: a thread with an event loop of its own, and bounds on what they take.

Whatever its clients do, or leave undone, holds up neither the screen nor the machine: those threads only start and
close it.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable
from contextlib import ExitStack, suppress
from queue import SimpleQueue

from drivers.errors import LinkError
from profiles.problem import Problem

GONE = (OSError, ValueError, asyncio.IncompleteReadError, TimeoutError)
"""What a client comes to that has left, sends a line without an end, or is too slow: there is nobody to tell."""

START_S, END_S = 5.0, 2.0

ROUNDS_OF_THE_LAST = 8
"""Of the loop: who was accepted in the last moment is connected, dropped and closed within these."""

ProtocolFactory = Callable[[], asyncio.Protocol]
Listen = Callable[[ProtocolFactory, ExitStack], Awaitable[tuple[asyncio.Server, str]]]
"""Listens with what is made for each client, and returns server and address; the stack ends all else of it.

Raises OSError.
"""

Converse = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
"""Serves one client to its end; may raise what is in `GONE`."""


async def send(writer: asyncio.StreamWriter, data: bytes, unread_s: float) -> None:
    """Send to a client. Raises TimeoutError: it has not read for so long."""
    writer.write(data)
    async with asyncio.timeout(unread_s):  # `wait_for` of Python 3.11 may lose a cancellation at its end
        await writer.drain()


def abandon(reading: asyncio.Task[bytes]) -> None:
    """Read no more, and take note of why nothing comes: asyncio would write that into the screen."""
    reading.cancel()
    reading.add_done_callback(lambda ended: ended.cancelled() or ended.exception())


class BoundedServer:
    """Listens from `start` or `launch` to `close`.

    At most `most_clients` are served at once; who comes beyond that is dropped. A line of a client may have
    `longest_line` bytes, and `unread_bytes` may wait for a client that does not read.
    """

    def __init__(
        self,
        name: str,
        listen: Listen,
        converse: Converse,
        *,
        most_clients: int,
        longest_line: int,
        unread_bytes: int,
    ) -> None:
        self._listen, self._converse = listen, converse
        self._most_clients, self._longest_line, self._unread_bytes = most_clients, longest_line, unread_bytes
        self._started: SimpleQueue[str | OSError] = SimpleQueue()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ended: asyncio.Event | None = None
        self._closing = threading.Event()
        self._clients = 0
        self.failed: OSError | None = None
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self, where: object) -> str:
        """Listen; return the address that was bound. Raises LinkError: `link.cannot_listen`, at `where`."""
        self._thread.start()
        came = self._started.get(timeout=START_S)
        if isinstance(came, OSError):
            problem = Problem(code="link.cannot_listen", where=str(where), value=came.strerror or str(came))
            raise LinkError(problem) from came
        return came

    def launch(self) -> None:
        """Begin to listen, and return at once; `failed` will say why where it cannot be done."""
        self._thread.start()

    def close(self) -> None:
        """Stop listening, and drop everybody; returns soon, whatever they do."""
        if not self._thread.is_alive():
            return
        self._closing.set()
        if self._loop is not None and self._ended is not None:
            with suppress(RuntimeError):  # its loop has ended
                self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(END_S)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        if self._closing.is_set():  # before there was a loop to tell
            return
        with ExitStack() as opened:
            try:
                server, bound = await self._listen(self._make_protocol, opened)
            except OSError as error:
                self.failed = error
                self._started.put(error)
                return
            self._started.put(bound)
            opened.callback(server.close)
            await self._ended.wait()
            await self._drop_the_last(server)

    async def _drop_the_last(self, server: asyncio.Server) -> None:
        """Accept nobody any more, and drop who was accepted just now: a closed server would leave them open."""
        for listening in server.sockets:
            asyncio.get_running_loop().remove_reader(listening.fileno())
        for _ in range(ROUNDS_OF_THE_LAST):
            await asyncio.sleep(0.0)

    def _make_protocol(self) -> asyncio.Protocol:
        reader = asyncio.StreamReader(limit=self._longest_line + 1)
        return asyncio.StreamReaderProtocol(reader, self._serve_client)

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one client until it leaves, or does what no client may."""
        self._clients += 1
        try:
            if self._clients <= self._most_clients and not self._closing.is_set():
                writer.transport.set_write_buffer_limits(high=self._unread_bytes)
                # Cancelled where the server ends; asyncio would write a traceback of that to the terminal.
                with suppress(*GONE, asyncio.CancelledError):
                    await self._converse(reader, writer)
        finally:
            self._clients -= 1
            writer.transport.abort()
