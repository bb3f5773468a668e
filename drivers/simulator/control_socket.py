"""The socket on which faults are asked for: a line of text each, answered as `faults.command` says."""

from __future__ import annotations

import asyncio
import os
import socket
import stat
from contextlib import ExitStack, closing, suppress

from drivers.link.address import TcpAddress
from drivers.simulator.control_address import PREFIX, ControlAddress, UnixAddress
from drivers.simulator.faults.command import answer
from drivers.simulator.machine import SimulatedLathe

LONGEST_LINE = 4096

OWNER_ONLY = 0o600


class ControlHost(asyncio.Protocol):
    """One who asks for faults."""

    def __init__(self, lathe: SimulatedLathe) -> None:
        self._lathe = lathe
        self._received = b""
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the way back."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """Answer each line that is complete; who sends one without an end is left."""
        *lines, self._received = (self._received + data).split(b"\n")
        for line in lines:
            self._transport.write(answer(self._lathe, line.decode("utf-8", "replace")).encode("utf-8", "replace"))
        if len(self._received) > LONGEST_LINE:
            self._transport.abort()

    def eof_received(self) -> bool:
        """A last line may lack its end. The connection is closed behind the answers."""
        if self._received.strip():
            self.data_received(b"\n")
        return False


async def listen_for_control(lathe: SimulatedLathe, address: ControlAddress, opened: ExitStack) -> str:
    """Listen, and return the address that was bound; `opened` closes it, and removes it from the file system.

    Raises:
        OSError: it cannot be done; also where the path is taken by anything but a socket that nobody serves.
    """
    loop = asyncio.get_running_loop()
    if isinstance(address, TcpAddress):
        server = await loop.create_server(lambda: ControlHost(lathe), address.host, address.port)
        opened.callback(server.close)
        host, port = server.sockets[0].getsockname()[:2]
        return f"{PREFIX}{TcpAddress(host=host, port=port)}"
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as listening:
        _bind(listening, address)
        opened.callback(_remove, address.path, os.stat(address.path).st_ino)
        server = await loop.create_unix_server(lambda: ControlHost(lathe), sock=listening.dup())
    opened.callback(server.close)
    return f"{PREFIX}{address}"


def _bind(listening: socket.socket, address: UnixAddress) -> None:
    """Take the path; one that a process has left behind when it died is taken over."""
    with suppress(FileNotFoundError):
        if stat.S_ISSOCK(os.lstat(address.path).st_mode) and not _served(address.path):
            os.unlink(address.path)
    before = os.umask(0o777 & ~OWNER_ONLY)
    try:
        listening.bind(address.path)
    finally:
        os.umask(before)


def _served(path: str) -> bool:
    """Whether somebody listens on a socket."""
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as probe:
        try:
            probe.connect(path)
        except ConnectionRefusedError:
            return False
        return True


def _remove(path: str, inode: int) -> None:
    """Remove our socket, and nobody else's that has come to stand there since."""
    with suppress(OSError):
        if os.lstat(path).st_ino == inode:
            os.unlink(path)
