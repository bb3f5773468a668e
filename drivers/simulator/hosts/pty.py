"""A pseudo-terminal in place of a serial line, with a stable name, and the simulated controller at its far end."""

from __future__ import annotations

import asyncio
import os
import tempfile
import time
import tty
from contextlib import suppress
from pathlib import Path

from drivers.simulator.commands.status import CONTROL_X
from drivers.simulator.hosts.connection import SLOW_READER, UNREAD_LIMIT, PlainStream, TurnScheduler
from drivers.simulator.machine import SimulatedLathe

FOLDER, NAME = "trilobe-", "pmac"
CHUNK = 4096


class PtyHost:
    """The only host of the line; `device` is the stable name that it opens, in a folder with owner-only access.

    Like a serial line it always exists: input left by one host is seen by the next one. Only a cut cable hangs it
    up. Then the name disappears, and returns with another pseudo-terminal. `heard_s` is the time of the host's
    last input, real time, None before the first.
    """

    def __init__(self, lathe: SimulatedLathe) -> None:
        """Create the pseudo-terminal, and listen on it in the running event loop. Raises OSError."""
        self._lathe = lathe
        self._loop = asyncio.get_running_loop()
        self._open = False
        self.device = os.path.join(tempfile.mkdtemp(prefix=FOLDER), NAME)
        self.heard_s: float | None = None
        try:
            self._plug_in()
        except OSError:
            remove_name(self.device)
            raise

    def flush(self) -> None:
        """Send the controller's replies as the line accepts them, and resume reading when it has room again.

        Without flow control, unread output is eventually lost.
        """
        if self._open and self._port.lost:
            self._hang_up()
        if self._open:
            self._turns.take()
        elif not self._lathe.lines.cut:
            with suppress(OSError):  # none is available now: the next flush tries again
                self._plug_in()

    def close(self) -> None:
        """Close permanently."""
        self._hang_up()
        remove_name(self.device)

    def _hang_up(self) -> None:
        if not self._open:
            return
        self._open = False
        with suppress(OSError):
            os.unlink(self.device)
        self._turns.end()
        self._loop.remove_reader(self._line)
        os.close(self._line)
        os.close(self._far_end)

    def _plug_in(self) -> None:
        # The far end is kept open here: a host that closes it would otherwise hang up the whole line.
        self._line, self._far_end = os.openpty()
        try:
            tty.setraw(self._far_end)
            _point_at(self.device, os.ttyname(self._far_end))
        except OSError:
            os.close(self._line)
            os.close(self._far_end)
            raise
        os.set_blocking(self._line, False)
        self._port = self._lathe.connect()
        self._stream = PlainStream(self._lathe, self._port)
        self._unsent = bytearray()
        self._turns = TurnScheduler(self._turn)
        self._reading = False
        self._open = True
        self._hold_back()

    def _receive(self) -> None:
        if self._port.lost:
            return
        try:
            data = os.read(self._line, CHUNK)
        except BlockingIOError:
            return
        self.heard_s = time.monotonic()
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
                pass  # the host is not reading now
        self._hold_back()
        return self._stream.busy and len(self._unsent) <= SLOW_READER

    def _hold_back(self) -> None:
        """Leave on the line the input that the controller has no room for."""
        target = not self._stream.crowded
        if target and not self._reading:
            self._loop.add_reader(self._line, self._receive)
        elif self._reading and not target:
            self._loop.remove_reader(self._line)
        self._reading = target


def _point_at(name: str, device: str) -> None:
    """Let a symbolic link lead to a device, without ever being absent once it exists."""
    fresh = f"{name}.new"
    os.symlink(device, fresh)
    os.replace(fresh, name)


def remove_name(path: str) -> None:
    """Remove a name with its folder, also one left by a dead process; nothing else."""
    name = Path(path)
    if name.name == NAME and name.parent.name.startswith(FOLDER):
        with suppress(OSError):
            if name.is_symlink():
                name.unlink()
            name.parent.rmdir()
