"""Temporary files that vanish with their writers, and the removal of those left by killed ones.

A running writer holds a lock on its file, which the kernel releases when the process ends, however it ends. So
a file that can be locked was left, whatever its date. On a file system without locks no file counts as left.
"""

from __future__ import annotations

import fcntl
import os
import stat
from contextlib import suppress
from pathlib import Path


def made_locked(path: Path, mode: int) -> int:
    """Create a new file, and return its descriptor, for writing, with the lock held.

    Raises `OSError`: it cannot be created, or exists.
    """
    while True:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if _is_at(descriptor, path):
            return descriptor
        os.close(descriptor)  # in between, another process has taken it for left and removed it


def taken_if_left(path: Path) -> int | None:
    """Return a locked descriptor of a file left by a dead process; None of any other file.

    Only a regular file of this user is ever taken.
    """
    try:
        # Neither follows a link nor waits for a pipe.
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        status = os.fstat(descriptor)
        if stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid():
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(descriptor, path):
                return descriptor
    except OSError:  # a running process holds the lock
        pass
    os.close(descriptor)
    return None


def remove_if_left(path: Path) -> None:
    """Remove a file left by a dead process, if there is one."""
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
