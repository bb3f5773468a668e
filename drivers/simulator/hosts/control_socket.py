"""The control socket: text lines, answered as `control_line` says."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
import stat
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress

from drivers.link.address import TcpAddress
from drivers.simulator.hosts.connection import Turns
from drivers.simulator.hosts.control_address import LONGEST_LINE, PREFIX, ControlAddress, UnixAddress
from drivers.simulator.hosts.control_line import answer
from drivers.simulator.machine import SimulatedLathe

LINES_A_TURN = 4  # maximum lines that are answered in one go; in between, the machine and its hosts have a turn
UNREAD_LIMIT = 65_536  # maximum reply bytes that wait for a client; beyond that, its input is not read
OWNER_ONLY = 0o600
SERVED_WITHIN_S = 1.0  # timeout to find out whether a path is still served


class ControlHost(asyncio.Protocol):
    """One client of the control socket."""

    def __init__(self, lathe: SimulatedLathe) -> None:
        self._lathe = lathe
        self._received = bytearray()
        self._ended = self._full = False
        self._turns = Turns(self._turn)
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport for replies."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.set_write_buffer_limits(high=UNREAD_LIMIT)

    def connection_lost(self, exc: Exception | None) -> None:
        """Discard the input of a client that has disconnected."""
        self._turns.end()

    def data_received(self, data: bytes) -> None:
        """Answer each complete line; drop a client that sends one without an end."""
        self._received += data
        self._turns.take()

    def eof_received(self) -> bool:
        """Accept a last line without its end. The connection is closed after the replies."""
        if self._received.rpartition(b"\n")[2].strip():
            self._received += b"\n"
        self._ended = True
        self._turns.take()
        return True

    def pause_writing(self) -> None:
        """Stop while the client does not read."""
        self._full = True

    def resume_writing(self) -> None:
        """Resume when it reads again."""
        self._full = False
        self._turns.take()

    def _turn(self) -> bool:
        """Answer the next few lines; return whether there are more that can be answered."""
        for _ in range(LINES_A_TURN):
            end = self._received.find(b"\n")
            if end < 0 or self._full:
                break
            line = bytes(self._received[: min(end, LONGEST_LINE + 1)])
            del self._received[: end + 1]
            self._transport.write(answer(self._lathe, line.decode("utf-8", "replace")).encode("utf-8", "replace"))
        more = b"\n" in self._received
        if more or self._full:
            if not self._ended:
                self._transport.pause_reading()
        elif self._ended:
            self._transport.close()
        elif len(self._received) > LONGEST_LINE:
            self._transport.abort()
        else:
            self._transport.resume_reading()
        return more and not self._full


async def listen_for_control(
    made: Callable[[], asyncio.Protocol], address: ControlAddress, opened: ExitStack
) -> tuple[asyncio.Server, str]:
    """Listen; return the server, and the address that was bound. `opened` closes it and removes its file.

    `made` makes what serves one client.

    Raises OSError: it cannot be done; also where the path is taken by anything but a socket that nobody serves.
    """
    loop = asyncio.get_running_loop()
    if isinstance(address, TcpAddress):
        server = await loop.create_server(made, address.host, address.port)
        opened.callback(server.close)
        host, port = server.sockets[0].getsockname()[:2]
        return server, f"{PREFIX}{TcpAddress(host=host, port=port)}"
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as listening:
        _bind(listening, address)
        opened.callback(_remove, address.path, os.stat(address.path).st_ino)
        server = await loop.create_unix_server(made, sock=listening.dup())
    opened.callback(server.close)
    return server, f"{PREFIX}{address}"


def _bind(listening: socket.socket, address: UnixAddress) -> None:
    """Bind the path; one left by a dead process is reused."""
    with suppress(FileNotFoundError):
        if stat.S_ISSOCK(os.lstat(address.path).st_mode) and not _served(address.path):
            os.unlink(address.path)
    before = os.umask(0o777 & ~OWNER_ONLY)
    try:
        listening.bind(address.path)
    finally:
        os.umask(before)


def _served(path: str) -> bool:
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as probe:
        probe.settimeout(SERVED_WITHIN_S)
        try:
            probe.connect(path)
        except ConnectionRefusedError:
            return False
        except OSError as error:
            if error.errno != errno.EAGAIN and not isinstance(error, TimeoutError):
                raise
        return True  # also when the backlog is full


def _remove(path: str, inode: int) -> None:
    """Remove our socket, but not another one that has since taken its path."""
    with suppress(OSError):
        if os.lstat(path).st_ino == inode:
            os.unlink(path)
