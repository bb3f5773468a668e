"""Open a serial line exclusively, and explain why it cannot be opened."""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import pwd
import stat
import struct
import termios
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import serial

from drivers.errors import LinkError
from drivers.link.address import SerialAddress
from profiles.problem import Problem

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


def open_line(address: SerialAddress) -> serial.Serial:
    """Open the device: 8 data bits, no parity, one stop bit, no flow control.

    Raises:
        LinkError: `link.no_device`, `link.no_permission`, `link.owner_only`, `link.busy`, `link.not_serial`,
            `link.baud`, `link.failed`.
    """
    try:
        line = serial.Serial(address.device, address.baud_rate, timeout=0, exclusive=True)
    except ValueError as error:
        raise _problem(address, "link.baud", value=str(address.baud_rate)) from error
    except OSError as error:
        raise _refusal(address, error) from error
    try:
        _check_speed(address, line.fileno())
        _keep_others_out(line.fileno())
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
