"""A link over a serial line: 8 data bits, no parity, one stop bit, no flow control."""

from __future__ import annotations

import errno
import os
import select
import threading
import time

import serial

from drivers.errors import LinkError
from drivers.link.address import SerialAddress
from profiles.problem import Problem

SEND_TIMEOUT_S = 2.0
URGENT_WAIT_S = 0.05
"""How long a stop waits for a line that is just being sent, so as not to cut it in two, and for room behind it."""

CHUNK = 65_536


class SerialLink:
    """One open serial device, for this program alone."""

    def __init__(self, address: SerialAddress) -> None:
        """Open the device.

        Raises:
            LinkError: `link.no_device`, it is missing, not permitted, in use or no serial line.
        """
        self.address = str(address)
        self._sending = threading.Lock()
        try:
            self._line = serial.Serial(address.device, address.baud_rate, timeout=0, exclusive=True)
        except (OSError, ValueError) as error:
            raise self._error("link.no_device", _reason(error)) from error

    def send(self, data: bytes) -> None:
        """Send bytes in order.

        Raises:
            LinkError: `link.lost`; also when the line has taken nothing for `SEND_TIMEOUT_S`.
        """
        try:
            with self._sending:
                self._send_all(data)
        except OSError as error:
            raise self._error("link.lost", _reason(error)) from error

    def send_urgent(self, data: bytes) -> None:
        """Send now: behind what the line has taken already, never behind what still waits in `send`.

        A signal handler may have interrupted the very send that holds the lock, so the wait for it is bounded.

        Raises:
            LinkError: `link.lost`; also when the line takes nothing within `URGENT_WAIT_S`, nothing is sent then.
        """
        deadline = time.monotonic() + URGENT_WAIT_S
        held = self._sending.acquire(timeout=URGENT_WAIT_S)
        try:
            self._squeeze_in(data, deadline)
        except OSError as error:
            raise self._error("link.lost", _reason(error)) from error
        finally:
            if held:
                self._sending.release()

    def receive(self, timeout_s: float) -> bytes:
        """Return what has come within `timeout_s`.

        Raises:
            LinkError: `link.lost`.
        """
        try:
            line = self._line.fileno()
            readable, _, _ = select.select([line], [], [], max(timeout_s, 0.0))
            if not readable:
                return b""
            data = os.read(line, CHUNK)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise self._error("link.lost", _reason(error)) from error
        if not data:
            raise self._error("link.lost", os.strerror(errno.ENXIO))
        return data

    def close(self) -> None:
        """Close the device. A send that is under way comes first, while it gets on."""
        held = self._sending.acquire(timeout=SEND_TIMEOUT_S)
        try:
            self._line.close()
        finally:
            if held:
                self._sending.release()

    def _send_all(self, data: bytes) -> None:
        line, deadline = self._line.fileno(), time.monotonic() + SEND_TIMEOUT_S
        while data:
            _, writable, _ = select.select([], [line], [], max(deadline - time.monotonic(), 0.0))
            if not writable:
                raise TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
            # A stop from another thread may have taken the room between the question and the writing.
            try:
                data = data[os.write(line, data) :]
            except BlockingIOError:
                continue

    def _squeeze_in(self, data: bytes, deadline: float) -> None:
        line = self._line.fileno()
        # Written first and asked then: a line has room for a stop long before it calls itself writable.
        try:
            sent = os.write(line, data)
        except BlockingIOError:
            select.select([], [line], [], max(deadline - time.monotonic(), 0.0))
            sent = os.write(line, data)
        if sent < len(data):
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    def _error(self, code: str, reason: str) -> LinkError:
        return LinkError(Problem(code=code, where=self.address, value=reason))


def _reason(error: OSError | ValueError) -> str:
    """Return the reason alone: pyserial wraps it into sentences of its own."""
    number = getattr(error, "errno", None)
    if number is None:
        return str(error)
    if isinstance(error, serial.SerialException) and number == errno.EAGAIN:
        number = errno.EBUSY  # the lock of another program
    return os.strerror(number)
