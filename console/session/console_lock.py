"""One console a machine on this computer: an advisory lock, and the number under which it owns the controller.

The kernel lets go of the lock when its process dies, so a lock that can be taken says that whoever held it is
gone; the number that it left tells whether the controller is still held by that one.
"""

from __future__ import annotations

import fcntl
import os
import re
from contextlib import suppress
from pathlib import Path

from console.session.errors import SessionError
from profiles.problem import Problem


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
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
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


def _unwritable(path: Path, error: OSError) -> SessionError:
    return SessionError(Problem(code="lock.unwritable", where=str(path), value=error.strerror or str(error)))


def _number(left: bytes) -> int:
    """Return what was left; a file that holds anything else has nothing to say."""
    word = left.strip()
    return int(word) if word.isdigit() else 0
