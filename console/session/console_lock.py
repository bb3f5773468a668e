"""One console a machine on this computer: an advisory lock, and the number under which it owns the controller.

The kernel lets go of the lock when its process dies, so a lock that can be taken says that whoever held it is
gone; the number that it left tells whether the controller is still held by that one.

What stands there may have been put there by somebody else: nothing is opened through a symbolic link, and nothing
is written to what is no plain file of this user alone.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import stat
from contextlib import suppress
from pathlib import Path

from console.session.errors import SessionError
from profiles.files import make_private_file, make_private_folder
from profiles.problem import Problem

FOREIGN = "not a plain file of this user"


class ConsoleLock:
    """A lock that was taken. `last_number` is that of the console that had it before, 0 where there was none."""

    def __init__(self, descriptor: int, last_number: int) -> None:
        """Use `take_lock`."""
        self.last_number = last_number
        self._descriptor = descriptor

    def keep(self, number: int) -> None:
        """Leave the number of this console for the one that comes next, if there is room for it."""
        with suppress(OSError):
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, f"{number}\n".encode("ascii"), 0)

    def close(self) -> None:
        """Let go of it."""
        os.close(self._descriptor)


def take_lock(data: Path, address: str) -> ConsoleLock | None:
    """Take the lock of the machine at an address; None while another console of this user holds it.

    How it is spoken to there (`?stop=`, `?baud=`) makes no other machine of it.

    Raises:
        SessionError: `lock.unwritable`.
    """
    place = address.rpartition("?")[0] or address
    path = data / "locks" / f"{re.sub(r'[^A-Za-z0-9.-]+', '_', place)}.lock"
    try:
        descriptor = _opened(path)
    except OSError as error:
        raise _unwritable(path, error) from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    except OSError as error:
        os.close(descriptor)
        raise _unwritable(path, error) from error
    return ConsoleLock(descriptor, _number(os.pread(descriptor, 32, 0)))


def _opened(path: Path) -> int:
    """Open the file of a lock, made where it is missing; nothing in it is changed.

    Raises:
        OSError: it cannot be opened, or is nothing that this user alone has made.
    """
    make_private_folder(path.parent)
    if path.parent.is_symlink() or path.is_symlink():
        raise OSError(errno.ELOOP, FOREIGN)
    make_private_file(path)
    # Not blocking: a pipe that somebody has put there would be waited for.
    descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode) or status.st_uid != os.geteuid() or status.st_nlink > 1:
        os.close(descriptor)
        raise OSError(errno.EPERM, FOREIGN)
    return descriptor


def _unwritable(path: Path, error: OSError) -> SessionError:
    return SessionError(Problem(code="lock.unwritable", where=str(path), value=error.strerror or str(error)))


def _number(left: bytes) -> int:
    """Return what was left; a file that holds anything else has nothing to say."""
    word = left.strip()
    return int(word) if word.isdigit() else 0
