"""A link over a serial line: 8 data bits, no parity, one stop bit, no flow control.

Without flow control only the line speed delays a stop. Data is therefore written in small portions, no faster than
the line transmits: a stop cannot overtake what the system and the adapter have already accepted.
"""

from __future__ import annotations

import errno
import fcntl
import os
import select
import struct
import termios
import threading
import time

from drivers.errors import LinkError
from drivers.link.address import SerialAddress
from drivers.link.base import StopWay
from drivers.link.pace import Pace
from drivers.link.serial_opening import open_line
from profiles.problem import Problem

SEND_TIMEOUT_S = 2.0
URGENT_WAIT_S = 0.02  # how long a stop waits for room on a full line
CHUNK = 65_536


class SerialLink:
    """One open serial device, exclusive to this program."""

    stop_way = StopWay.DIRECT
    checks_bytes = False

    def __init__(self, address: SerialAddress) -> None:
        """Open the device; errors as for `open_line`."""
        self.address = str(address)
        self._pace = Pace(address.baud_rate)
        # Re-entrant: a signal handler may interrupt the very thread that holds it, and must not block.
        self._handing = threading.RLock()
        self._line = open_line(address)

    def send(self, data: bytes) -> None:
        """Send bytes in order, queueing no more than a stop may have to wait for.

        Raises LinkError: `link.lost`; also when the line has accepted nothing for `SEND_TIMEOUT_S`.
        """
        try:
            left, last_s = memoryview(data), time.monotonic()
            while left:
                sent = self._hand_over(left)
                left = left[sent:]
                now_s = time.monotonic()
                if sent:
                    last_s = now_s
                elif now_s - last_s > SEND_TIMEOUT_S:
                    raise TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
                if left:
                    time.sleep(self._pace.wait_s(now_s))
        except (OSError, ValueError) as error:
            raise self._lost(error) from error

    def send_urgent(self, data: bytes) -> None:
        """Send now: after what the line has accepted already, before whatever still waits in `send`.

        Raises LinkError: `link.lost`; also when the line accepts nothing within `URGENT_WAIT_S`: nothing was sent.
        """
        deadline = time.monotonic() + URGENT_WAIT_S
        held = self._handing.acquire(timeout=URGENT_WAIT_S)
        try:
            self._squeeze_in(data, deadline)
        except (OSError, ValueError) as error:  # a closed line has no descriptor
            raise self._lost(error) from error
        finally:
            if held:
                self._handing.release()

    def receive(self, timeout_s: float) -> bytes:
        """Return the bytes received within `timeout_s`. Raises LinkError: `link.lost`."""
        try:
            line = self._line.fileno()
            readable, _, _ = select.select([line], [], [], max(timeout_s, 0.0))
            if not readable:
                return b""
            data = os.read(line, CHUNK)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise self._lost(error) from error
        if not data:
            raise self._lost(OSError(errno.ENXIO, os.strerror(errno.ENXIO)))
        return data

    def close(self) -> None:
        """Close the device."""
        with self._handing:
            self._line.close()

    def _hand_over(self, data: memoryview) -> int:
        with self._handing:
            line, now_s = self._line.fileno(), time.monotonic()
            room = min(self._pace.room(now_s), self._pace.ahead - _queued(line))
            if room <= 0:
                return 0
            try:
                sent = os.write(line, data[:room])
            except BlockingIOError:
                return 0
            self._pace.handed(sent, now_s)
        return sent

    def _squeeze_in(self, data: bytes, deadline: float) -> None:
        line = self._line.fileno()
        # Write first, then wait: a line has room for a stop long before it reports itself writable.
        try:
            sent = os.write(line, data)
        except BlockingIOError:
            select.select([], [line], [], max(deadline - time.monotonic(), 0.0))
            sent = os.write(line, data)
        if sent < len(data):
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        self._pace.handed(sent, time.monotonic())

    def _lost(self, error: OSError | ValueError) -> LinkError:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        return LinkError(Problem(code="link.lost", where=self.address, value=reason))


def _queued(line: int) -> int:
    """Return how many bytes the system has not sent yet; not every driver reports it."""
    try:
        return int(struct.unpack("i", fcntl.ioctl(line, termios.TIOCOUTQ, bytes(4)))[0])
    except OSError:
        return 0
