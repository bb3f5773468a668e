"""A server for clients that nobody trusts: what they have open when it ends is closed with it."""

from __future__ import annotations

import asyncio
import gc
import socket
import threading
import warnings
from contextlib import ExitStack
from pathlib import Path

from console.session.bounded_server import BoundedServer, ProtocolFactory

TIMES = 5


async def talk(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while True:
        writer.write(b"x\n")
        await writer.drain()
        await asyncio.sleep(0.01)


def served(path: Path) -> BoundedServer:
    async def listen(made: ProtocolFactory, _: ExitStack) -> tuple[asyncio.Server, str]:
        return await asyncio.get_running_loop().create_unix_server(made, path), str(path)

    return BoundedServer("test", listen, talk, most_clients=4, longest_line=100, unread_bytes=0)


def connect_until(over: threading.Event, path: Path, opened: list[socket.socket]) -> None:
    """Connect as fast as it goes, to its end and beyond."""
    while not over.is_set():
        opened.append(socket.socket(socket.AF_UNIX))
        opened[-1].settimeout(0.2)
        try:
            opened[-1].connect(str(path))
        except OSError:
            return


def test_who_connects_while_it_ends_is_dropped_and_nothing_stays_open(tmp_path: Path) -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ResourceWarning)
        for number in range(TIMES):
            path, over, opened = tmp_path / str(number), threading.Event(), list[socket.socket]()
            server = served(path)
            server.start("here")
            crowd = threading.Thread(target=connect_until, args=(over, path, opened))
            crowd.start()
            while len(opened) < 20 and crowd.is_alive():
                over.wait(0.001)
            assert len(opened) >= 20
            server.close()
            over.set()
            crowd.join()
            for each in opened:
                each.close()
        gc.collect()
    messages = [str(each.message) for each in told]
    assert [each for each in messages if "database" not in each] == []  # those are of tests before this one
