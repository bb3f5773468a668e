"""Files that are gone with whoever writes them, and those that a killed one has left.

Whoever lives holds a lock on his file, which the kernel lets go of when a process ends, however it ends. So a file
that can be locked was left, whatever its date says. On a file system without locks none is ever taken for left.
"""

from __future__ import annotations

import fcntl
import os
import stat
from contextlib import suppress
from pathlib import Path


def made_locked(path: Path, mode: int) -> int:
    """Make a file that is not there, and return its descriptor, for writing, with the lock held.

    Raises:
        OSError: it cannot be made, or is there.
    """
    while True:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if _is_at(descriptor, path):
            return descriptor
        os.close(descriptor)  # between the two, somebody has taken it for left, and away


def taken_if_left(path: Path) -> int | None:
    """Return a descriptor of a file that somebody who is gone has left, with its lock held; None of any other.

    Only a plain file of this user is ever taken.
    """
    try:
        # Neither through a link nor waiting for a pipe.
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        status = os.fstat(descriptor)
        if stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid():
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(descriptor, path):
                return descriptor
    except OSError:  # somebody has the lock, and lives
        pass
    os.close(descriptor)
    return None


def remove_if_left(path: Path) -> None:
    """Take a file away that somebody who is gone has left, if there is one."""
    descriptor = taken_if_left(path)
    if descriptor is not None:
        with suppress(OSError):
            path.unlink()
        os.close(descriptor)


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether a path still leads to an open file."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path, follow_symlinks=False))
    except OSError:
        return False
