"""A pseudo-terminal in the place of a serial line, with the simulated card at its far end."""

from __future__ import annotations

import asyncio
import os
import tty

from drivers.simulator.connection import SLOW_READER, UNREAD_LIMIT, PlainStream, Turns
from drivers.simulator.control_characters import CONTROL_X
from drivers.simulator.machine import SimulatedLathe

CHUNK = 4096


class PtyHost:
    """The one host of the line; `device` is where it finds it.

    Like a serial line it is always there: what a host that goes has left, the next one finds.
    """

    def __init__(self, lathe: SimulatedLathe) -> None:
        """Make the pseudo-terminal, and listen on it in the running event loop."""
        self._stream = PlainStream(lathe, lathe.connect())
        self._unsent = bytearray()
        # The far end stays open here: a host that closes it would otherwise hang up the whole line.
        self._line, self._far_end = os.openpty()
        tty.setraw(self._far_end)
        os.set_blocking(self._line, False)
        self.device = os.ttyname(self._far_end)
        self._loop = asyncio.get_running_loop()
        self._turns = Turns(self._turn)
        self._reading = False
        self._hold_back()

    def flush(self) -> None:
        """Send what the card has answered and the line takes, and read on when the card has room again.

        Without a handshake, what nobody reads is lost in the end.
        """
        self._turns.take()

    def close(self) -> None:
        """Hang up."""
        self._turns.end()
        self._loop.remove_reader(self._line)
        os.close(self._line)
        os.close(self._far_end)

    def _receive(self) -> None:
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
