"""A pseudo-terminal in the place of a serial line, with the simulated card at its far end."""

from __future__ import annotations

import asyncio
import os
import tty
from collections.abc import Callable

from drivers.simulator.connection import SLOW_READER, UNREAD_LIMIT, PlainStream, Turns
from drivers.simulator.control_characters import CONTROL_X
from drivers.simulator.machine import SimulatedLathe

CHUNK = 4096

PATIENCE_FLUSHES = 200
"""How often a line that was cut looks for its old name before it takes another: about a second."""


class PtyHost:
    """The one host of the line; `device` is where it finds it.

    Like a serial line it is always there: what a host that goes has left, the next one finds. Only a cut cable
    hangs it up. Then it comes back where it was once the last host has let go of it, or else under another name,
    which `renamed` is told.
    """

    def __init__(self, lathe: SimulatedLathe, renamed: Callable[[str], None] = lambda _: None) -> None:
        """Make the pseudo-terminal, and listen on it in the running event loop."""
        self._lathe = lathe
        self._renamed = renamed
        self._loop = asyncio.get_running_loop()
        self._open = False
        self.device = ""
        self._patience = PATIENCE_FLUSHES
        self._plug_in(*os.openpty())

    def flush(self) -> None:
        """Send what the card has answered and the line takes, and read on when the card has room again.

        Without a handshake, what nobody reads is lost in the end.
        """
        if self._open and self._port.lost:
            self.close()
        if self._open:
            self._turns.take()
        elif not self._lathe.lines.cut:
            self._plug_in_again()

    def close(self) -> None:
        """Hang up."""
        if not self._open:
            return
        self._open = False
        self._turns.end()
        self._loop.remove_reader(self._line)
        os.close(self._line)
        os.close(self._far_end)

    def _plug_in(self, line: int, far_end: int) -> None:
        # The far end stays open here: a host that closes it would otherwise hang up the whole line.
        self._line, self._far_end = line, far_end
        tty.setraw(far_end)
        os.set_blocking(line, False)
        self.device = os.ttyname(far_end)
        self._port = self._lathe.connect()
        self._stream = PlainStream(self._lathe, self._port)
        self._unsent = bytearray()
        self._turns = Turns(self._turn)
        self._reading = False
        self._open = True
        self._hold_back()

    def _plug_in_again(self) -> None:
        ends = os.openpty()
        name, before = os.ttyname(ends[1]), self.device
        if name != before and self._patience > 0:
            self._patience -= 1
            for end in ends:
                os.close(end)
            return
        self._patience = PATIENCE_FLUSHES
        self._plug_in(*ends)
        if name != before:
            self._renamed(name)

    def _receive(self) -> None:
        if self._port.lost:
            return
        try:
            data = os.read(self._line, CHUNK)
        except BlockingIOError:
            return
        if CONTROL_X in data:
            self._unsent.clear()
        self._stream.receive(data)
        if len(self._unsent) <= SLOW_READER:
            self._turns.take()
        else:
            self._hold_back()

    def _turn(self) -> bool:
        if self._port.lost:
            return False  # the next flush hangs up
        for said in self._stream.turn():
            self._unsent += said
        del self._unsent[UNREAD_LIMIT:]
        if self._unsent:
            try:
                del self._unsent[: os.write(self._line, self._unsent)]
            except BlockingIOError:
                pass  # the host does not read at the moment
        self._hold_back()
        return self._stream.busy and len(self._unsent) <= SLOW_READER

    def _hold_back(self) -> None:
        """Leave on the line what the card has no room for."""
        wanted = not self._stream.crowded
        if wanted and not self._reading:
            self._loop.add_reader(self._line, self._receive)
        elif self._reading and not wanted:
            self._loop.remove_reader(self._line)
        self._reading = wanted
