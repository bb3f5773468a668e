"""A pseudo-terminal in the place of a serial line, with the simulated card at its far end."""

from __future__ import annotations

import asyncio
import os
import tty

from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.real_time import UNREAD_LIMIT

CHUNK = 4096
CONTROL_X = b"\x18"


class PtyHost:
    """The one host of the card; `device` is where it finds the line.

    Like a serial line it is always there: what a host that goes has left, the next one finds.
    """

    def __init__(self, lathe: SimulatedLathe) -> None:
        """Make the pseudo-terminal, and listen on it in the running event loop."""
        self._port = lathe.connect()
        self._unsent = bytearray()
        # The far end stays open here: a host that closes it would otherwise hang up the whole line.
        self._line, self._far_end = os.openpty()
        tty.setraw(self._far_end)
        os.set_blocking(self._line, False)
        self.device = os.ttyname(self._far_end)
        self._loop = asyncio.get_running_loop()
        self._reading = False
        self._hold_back()

    def flush(self) -> None:
        """Send what the card has answered and the line takes, and read on when the card has room again.

        Without a handshake, what nobody reads is lost in the end.
        """
        self._hold_back()
        self._unsent += self._port.take_output()
        del self._unsent[UNREAD_LIMIT:]
        if self._unsent:
            try:
                del self._unsent[: os.write(self._line, self._unsent)]
            except BlockingIOError:
                pass  # the host does not read at the moment

    def close(self) -> None:
        """Hang up."""
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
        self._port.receive(data)
        self._hold_back()

    def _hold_back(self) -> None:
        """Leave on the line what the card has no room for."""
        wanted = not self._port.crowded
        if wanted and not self._reading:
            self._loop.add_reader(self._line, self._receive)
        elif self._reading and not wanted:
            self._loop.remove_reader(self._line)
        self._reading = wanted
