"""A link over a serial line: 8 data bits, no parity, one stop bit unless stated, no flow control.

Without flow control only the line speed delays a stop. Data is therefore written in small portions, no faster than
the line transmits: a stop cannot overtake what the system and the adapter have already accepted.
"""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import pwd
import select
import stat
import struct
import termios
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass
from pathlib import Path

import serial

from drivers.errors import LinkError
from drivers.link.address import SerialAddress
from drivers.link.base import StopWay
from profiles.problem import Problem

SEND_TIMEOUT_S = 2.0
URGENT_WAIT_S = 0.02  # how long a stop waits for room on a full line
CHUNK = 65_536
AHEAD_S = 0.010  # transmission time that may be queued on a line: the longest that a stop waits
CHARACTER_BITS = 10  # a start bit, 8 data bits, a stop bit
LEAST_WAIT_S = 0.001
BAUD_TOLERANCE = 0.02  # of the actual line speed; characters are still received correctly within it
_REFUSALS = {
    errno.ENOENT: "link.no_device",
    errno.ENOTDIR: "link.no_device",
    errno.ENXIO: "link.no_device",
    errno.ENODEV: "link.no_device",
    errno.EIO: "link.no_device",  # a device name that the system keeps for a port that does not exist
    errno.EAGAIN: "link.busy",  # locked by another program
    errno.EBUSY: "link.busy",
    errno.EISDIR: "link.not_serial",
    errno.ENOTTY: "link.not_serial",
    errno.EINVAL: "link.not_serial",
    errno.EACCES: "link.no_permission",
    errno.EPERM: "link.no_permission",
}

_TCGETS2, _TERMIOS2 = 0x802C_542A, struct.Struct("4IB19s2I")
"""Requests the settings with the speed as a number; the layout of most processor architectures, not of all."""

_PSEUDO_TERMINALS = range(136, 144)  # major device numbers


@dataclass(frozen=True, slots=True)
class Framing:
    """The bits of a character on the line; a wrong parity is received as the byte 0."""

    bits: int = 8
    parity: str = serial.PARITY_NONE
    stop_bits: int = 1


EIGHT_BITS = Framing()


class LinePace:
    """Computes from the line speed what has been transmitted; buffers on the way need not be known."""

    def __init__(self, baud_rate: int) -> None:
        self._character_s = CHARACTER_BITS / baud_rate
        self._clear_at_s = 0.0

    @property
    def queue_room_bytes(self) -> int:
        """Return how many bytes may be queued on the line; at least one, or nothing would ever be sent."""
        return max(int(AHEAD_S / self._character_s), 1)

    def room(self, now_s: float) -> int:
        """Return how many bytes may be queued now."""
        waiting_s = max(self._clear_at_s - now_s, 0.0)
        # Rounding guard: binary fractions must not push a whole number just below itself.
        return max(self.queue_room_bytes - int(waiting_s / self._character_s + 0.999), 0)

    def wait_s(self, now_s: float) -> float:
        """Return the time until half of the queue has been transmitted: often enough to keep the line busy."""
        waiting_s = max(self._clear_at_s - now_s, 0.0)
        return max(waiting_s - self.queue_room_bytes // 2 * self._character_s, self._character_s, LEAST_WAIT_S)

    def record_sent_bytes(self, count: int, now_s: float) -> None:
        """Record bytes that the line has accepted."""
        self._clear_at_s = max(self._clear_at_s, now_s) + count * self._character_s


def open_line(address: SerialAddress, framing: Framing = EIGHT_BITS) -> serial.Serial:
    """Open the device, without flow control.

    Raises:
        LinkError: `link.no_device`, `link.no_permission`, `link.owner_only`, `link.busy`, `link.not_serial`,
            `link.baud`, `link.failed`.
    """
    try:
        kind = astuple(framing)
        line = serial.Serial(address.device, address.baud_rate, *kind, timeout=0, exclusive=True)
    except ValueError as error:
        raise _problem(address, "link.baud", value=str(address.baud_rate)) from error
    except OSError as error:
        raise _refusal(address, error) from error
    try:
        _check_speed(address, line.fileno())
        _keep_others_out(line.fileno())
        if framing.parity != serial.PARITY_NONE:
            _check_parity(line.fileno())
    except BaseException:
        line.close()
        raise
    return line


def speed_of(line: int) -> int | None:
    """Return the speed of an open line in bit/s, None where the system does not report it."""
    try:
        answer = fcntl.ioctl(line, _TCGETS2, bytes(_TERMIOS2.size))
    except OSError:
        return None
    return int(_TERMIOS2.unpack(answer)[-1])


def _check_speed(address: SerialAddress, line: int) -> None:
    """Check the actual speed: a driver that cannot set the requested one silently keeps another."""
    speed = speed_of(line)
    if speed is not None and abs(speed - address.baud_rate) > BAUD_TOLERANCE * address.baud_rate:
        raise _problem(address, "link.baud", value=str(address.baud_rate), limit=str(speed))


def _keep_others_out(line: int) -> None:
    """Have the system refuse programs that do not use the lock.

    Not on a pseudo-terminal: it would stay exclusive after this program is killed, closed to everybody from then
    on.
    """
    if os.major(os.fstat(line).st_rdev) not in _PSEUDO_TERMINALS:
        with suppress(OSError):
            fcntl.ioctl(line, termios.TIOCEXCL)


def _check_parity(line: int) -> None:
    """Have the system check the parity that it receives, which pyserial leaves off."""
    settings = termios.tcgetattr(line)
    settings[0] = (settings[0] | termios.INPCK) & ~(termios.IGNPAR | termios.PARMRK)
    termios.tcsetattr(line, termios.TCSANOW, settings)


def _refusal(address: SerialAddress, error: OSError) -> LinkError:
    number, before = error.errno or 0, error.__context__
    if not number and isinstance(before, termios.error):  # pyserial hides that of the settings behind its own
        number = before.args[0]
    code = _REFUSALS.get(number, "link.failed")
    reason = os.strerror(number) if number else str(error)
    if code == "link.busy":
        return _problem(address, code, value=_holder(address.device) or reason)
    if code == "link.no_permission":
        return _not_permitted(address)
    return _problem(address, code, value=reason)


def _not_permitted(address: SerialAddress) -> LinkError:
    try:
        owned = os.stat(address.device)
    except OSError as error:  # not even the directory may be read
        return _problem(address, "link.failed", value=os.strerror(error.errno or 0))
    mode = stat.filemode(owned.st_mode)
    if owned.st_mode & stat.S_IRGRP and owned.st_mode & stat.S_IWGRP:
        return _problem(address, "link.no_permission", value=mode, limit=_name(grp.getgrgid, owned.st_gid))
    return _problem(address, "link.owner_only", value=mode, limit=_name(pwd.getpwuid, owned.st_uid))


def _name(look_up: Callable[[int], Sequence[object]], number: int) -> str:
    try:
        return str(look_up(number)[0])
    except KeyError:
        return str(number)


def _holder(device: str) -> str:
    """Return which program has locked the device, as far as the system reports it; else empty."""
    try:
        node = os.stat(device)
        where = f"{os.major(node.st_dev):02x}:{os.minor(node.st_dev):02x}:{node.st_ino}"
        for lock in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            number, held = lock.split()[-4:-2]
            if held == where and number.isdigit():
                name = Path(f"/proc/{number}/comm").read_text(encoding="utf-8", errors="replace").strip()
                return f"{name}, PID {number}" if name.isprintable() else f"PID {number}"
    except (OSError, ValueError):
        pass
    return ""


def _problem(address: SerialAddress, code: str, *, value: str = "", limit: str = "") -> LinkError:
    return LinkError(Problem(code=code, where=str(address), value=value, limit=limit))


class SerialLink:
    """One open serial device, exclusive to this program."""

    stop_way = StopWay.DIRECT
    checks_bytes = False

    def __init__(self, address: SerialAddress, framing: Framing = EIGHT_BITS) -> None:
        """Open the device; errors as for `open_line`."""
        self.address = str(address)
        self._pace = LinePace(address.baud_rate)
        # Re-entrant: a signal handler may interrupt the very thread that holds it, and must not block.
        self._handing = threading.RLock()
        self._line = open_line(address, framing)

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
            raise self._lost_error(error) from error

    def send_urgent(self, data: bytes) -> None:
        """Send now: after what the line has accepted already, before whatever still waits in `send`.

        Raises LinkError: `link.lost`; also when the line accepts nothing within `URGENT_WAIT_S`: nothing was sent.
        """
        deadline = time.monotonic() + URGENT_WAIT_S
        held = self._handing.acquire(timeout=URGENT_WAIT_S)
        try:
            self._squeeze_in(data, deadline)
        except (OSError, ValueError) as error:  # a closed line has no descriptor
            raise self._lost_error(error) from error
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
            raise self._lost_error(error) from error
        if not data:
            raise self._lost_error(OSError(errno.ENXIO, os.strerror(errno.ENXIO)))
        return data

    def close(self) -> None:
        """Close the device."""
        with self._handing:
            self._line.close()

    def _hand_over(self, data: memoryview) -> int:
        with self._handing:
            line, now_s = self._line.fileno(), time.monotonic()
            room = min(self._pace.room(now_s), self._pace.queue_room_bytes - _count_queued_bytes(line))
            if room <= 0:
                return 0
            try:
                sent = os.write(line, data[:room])
            except BlockingIOError:
                return 0
            self._pace.record_sent_bytes(sent, now_s)
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
        self._pace.record_sent_bytes(sent, time.monotonic())

    def _lost_error(self, error: OSError | ValueError) -> LinkError:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        return LinkError(Problem(code="link.lost", where=self.address, value=reason))


def _count_queued_bytes(line: int) -> int:
    """Return how many bytes the system has not sent yet; not every driver reports it."""
    try:
        return int(struct.unpack("i", fcntl.ioctl(line, termios.TIOCOUTQ, bytes(4)))[0])
    except OSError:
        return 0
