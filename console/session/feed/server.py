"""The thread that serves the readers of a feed. It waits for nobody, and nobody waits for it.

A reader may send one line that says its rate; all else that it sends is left unread. Without readers the thread
sleeps. One that does not read is dropped once the few lines have filled up that the system keeps for it.
"""

from __future__ import annotations

import asyncio
import math
import os
import socket
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

from console.session.bounded_server import BoundedServer, ProtocolFactory, abandon, send
from console.session.data.kept_files import utc_now
from console.session.errors import fault_problem
from console.session.feed.feed_state import FeedState
from console.session.feed.observed_state import ObservedState
from console.session.feed.place import claim_place
from console.session.feed.report import line_of, report
from console.session.feed.request import FORM, LEAST_HZ, LONGEST_LINE, SCHEMA, asked_hz
from console.session.operator import operator_name
from profiles.files import printable
from profiles.problem import Problem

MOST_READERS = 16
HELLO_S = 0.25  # for a reader to say its rate before the first line; later counts, too
UNREAD_S = 5.0  # timeout for a reader that does not read
KEPT_BYTES = 8192  # that the system keeps for a reader: some lines
SHARED_S = 0.05  # a line this young is sent to another reader, too: the cost does not rise with their number


class FeedServer:
    """Publishes what `observe` returns from `launch` to `close`. It is called in the thread of the feed."""

    def __init__(self, data: Path, observe: Callable[[], ObservedState]) -> None:
        self._data, self._observe = data, observe
        self._line: tuple[float, bytes] = (float("-inf"), b"")
        self._server = BoundedServer(
            "feed",
            self._listen,
            self._converse,
            most_clients=MOST_READERS,
            longest_line=LONGEST_LINE,
            unread_bytes=0,
        )

    def launch(self) -> None:
        """Begin to publish; returns at once."""
        self._server.launch()

    def close(self) -> None:
        """Drop every reader, and remove the socket; returns soon."""
        self._server.close()

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Why nothing was published: a folder that is full or closed. The console works without."""
        error = self._server.failed
        if error is None:
            return ()
        value = error.strerror or str(error)
        return (Problem(code="feed.not_served", where=printable(str(self._data)), value=value),)

    async def _listen(self, made: ProtocolFactory, opened: ExitStack) -> tuple[asyncio.Server, str]:
        listening = claim_place(self._data, opened)
        # Not `create_unix_server`: from Python 3.13 on that looks its name up, to remove it, and the short one of
        # a long path is gone by then. `opened` removes it.
        server = await asyncio.get_running_loop().create_server(made, sock=listening.dup())
        return server, str(listening.getsockname())

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = writer.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, KEPT_BYTES)
        asked: asyncio.Task[bytes] = asyncio.create_task(reader.readline())
        waiting, period_s = {asked}, 1.0 / LEAST_HZ
        try:
            await _pause(waiting, HELLO_S)
            while True:
                if asked in waiting and asked.done():
                    waiting, hz = set(), asked_hz(asked.result())
                    if hz is None:
                        await send(writer, line_of({"schema": SCHEMA, "refused": FORM}), UNREAD_S)
                        return
                    period_s = 1.0 / hz
                began_s = asyncio.get_running_loop().time()
                await send(writer, self._newest(began_s), UNREAD_S)
                left_s = began_s + period_s - asyncio.get_running_loop().time()
                await _pause(waiting, left_s)
        except asyncio.CancelledError:  # the console ends; who reads seldom learns of what ended it, too
            writer.write(self._newest(math.inf))
            raise
        finally:
            abandon(asked)

    def _newest(self, now_s: float) -> bytes:
        made_s, line = self._line
        if now_s - made_s >= SHARED_S:
            try:
                line = line_of(asdict(self._report()))
            except Exception as fault:  # nothing of a feed may reach the terminal of the operator
                line = line_of({"schema": SCHEMA, "refused": fault_problem(fault).value})
            self._line = now_s, line
        return line

    def _report(self) -> FeedState:
        return report(self._observe(), process=os.getpid(), operator=operator_name(), at_utc=utc_now())


async def _pause(waiting: set[asyncio.Task[bytes]], left_s: float) -> None:
    """Wait until the next line is due, or the reader has said its rate."""
    if waiting:
        await asyncio.wait(waiting, timeout=max(left_s, 0.0))
    else:
        await asyncio.sleep(max(left_s, 0.0))
