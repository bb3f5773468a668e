"""One connected host: bytes between a transport and its port of the controller.

A host's input is executed as it arrives, between two blocks of servo cycles and without advancing time; the rest
gets its next turn after those of the others.
"""

from __future__ import annotations

import asyncio
import socket
import struct
from collections.abc import Callable

from drivers.errors import LinkError
from drivers.pmac.ethernet import MalformedRequestError
from drivers.simulator.hosts.port import Port
from drivers.simulator.hosts.real_time import Host
from drivers.simulator.machine import SimulatedLathe

UNREAD_LIMIT = 1_000_000  # maximum buffered reply bytes for a host that does not read
SLOW_READER = 65_536  # unread bytes beyond which a host is served only in the background


class PlainStream:
    """Converts a host's bytes to lines for its port, and replies to bytes: here the ASCII of a serial line."""

    def __init__(self, lathe: SimulatedLathe, port: Port) -> None:
        self._lathe = lathe
        self._port = port

    @property
    def crowded(self) -> bool:
        """Whether more input is pending than allowed."""
        return self._port.crowded

    @property
    def busy(self) -> bool:
        """Whether lines are left that may be executed in this cycle."""
        return self._port.ready

    @property
    def idle(self) -> bool:
        """Whether all input has been executed and answered; half a line does not count."""
        return self._port.idle

    def receive(self, data: bytes) -> None:
        """Take bytes from the host."""
        self._port.receive(data)

    def turn(self) -> list[bytes]:
        """Execute the next few lines; return what to send, each item in one go. Raises MalformedRequestError."""
        self._lathe.attend(self._port)
        said = self._port.take_output()
        return [said] if said else []


Begin = Callable[[SimulatedLathe, Port], PlainStream]  # creates the discipline of a new connection


class TurnScheduler:
    """Repeats work while there is more of it; other hosts have a turn in between."""

    def __init__(self, work: Callable[[], bool]) -> None:
        self._work = work
        self._loop = asyncio.get_running_loop()
        self._next: asyncio.Handle | None = None

    def take(self) -> None:
        """Take a turn now, and further ones later."""
        more = self._work()
        if more and self._next is None:
            self._next = self._loop.call_soon(self._follow)

    def end(self) -> None:
        """Stop taking turns."""
        self._work = lambda: False

    def _follow(self) -> None:
        self._next = None
        self.take()


def _reset(transport: asyncio.Transport) -> None:
    """End a connection as broken: the host sees a reset, not a close."""
    line = transport.get_extra_info("socket")
    if line is not None:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    transport.abort()


class HostConnection(asyncio.Protocol):
    """One host on a socket."""

    def __init__(self, lathe: SimulatedLathe, hosts: set[Host], discipline: Begin) -> None:
        self._lathe = lathe
        self._hosts = hosts
        self._begin = discipline
        self._port: Port | None = None
        self._ended = False
        self._discipline: PlainStream
        self._transport: asyncio.Transport
        self._turns: TurnScheduler

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Plug the host in."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        try:
            self._port = self._lathe.connect()
        except LinkError:
            transport.abort()
            return
        self._discipline = self._begin(self._lathe, self._port)
        self._turns = TurnScheduler(self._turn)
        self._hosts.add(self)

    def data_received(self, data: bytes) -> None:
        """Accept the host's input, and answer it if it reads its replies."""
        if self._port is None or self._cut_off(self._port):
            return
        self._discipline.receive(data)
        if self._transport.get_write_buffer_size() <= SLOW_READER:
            self._turns.take()
        else:
            self._hold_back()

    def eof_received(self) -> bool:
        """Handle the host's end of input: it may still read, and is closed after the replies."""
        self._ended = True
        self.flush()
        return True

    def connection_lost(self, exc: Exception | None) -> None:
        """Unplug the host."""
        self._unplug()

    def flush(self) -> None:
        """Send the controller's replies, and resume reading when it has room again."""
        if self._port is not None and not self._cut_off(self._port):
            self._turns.take()

    def _cut_off(self, port: Port) -> bool:
        """Reset the connection where the cable is cut."""
        if port.lost:
            self._unplug()
            _reset(self._transport)
        return port.lost

    def _turn(self) -> bool:
        if self._port is None or self._cut_off(self._port):
            return False
        try:
            replies = self._discipline.turn()
        except MalformedRequestError:
            return self._end()
        for reply in replies:
            if self._transport.is_closing():
                return False  # the host disconnected before its replies; `connection_lost` follows
            self._transport.write(reply)
        unread = self._transport.get_write_buffer_size()
        if unread > UNREAD_LIMIT:
            self._unplug()
            self._transport.abort()
            return False
        if self._ended and self._discipline.idle:
            return self._end()
        self._hold_back()
        return self._discipline.busy and unread <= SLOW_READER

    def _end(self) -> bool:
        self._unplug()
        self._transport.close()
        return False

    def _hold_back(self) -> None:
        """Leave input that the controller has no room for in the network buffers."""
        if not self._discipline.crowded:
            self._transport.resume_reading()
        elif self._transport.is_reading():
            self._transport.pause_reading()

    def _unplug(self) -> None:
        self._hosts.discard(self)
        if self._port is not None:
            self._lathe.disconnect(self._port)
            self._port = None
            self._turns.end()
