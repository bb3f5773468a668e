"""Where the feeds of a data folder are: `feed/PROCESS.socket`, with `PROCESS.lock` beside it, held by its console.

The kernel releases the lock however a process ends, so a socket without its lock was left by a killed console.
"""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from profiles.files import made_locked, make_private_folder, rights_in, taken_if_left

FOLDER, SOCKET, LOCK = "feed", ".socket", ".lock"
LONGEST_PATH = 107  # bytes of the path of a socket that Linux has room for
MOST_OF_A_PROCESS = 100  # names tried: a process of the same number may run in another container


def claim_place(data: Path, opened: ExitStack) -> socket.socket:
    """Return a socket that is bound to a place of this process, and does not listen yet; `opened` removes it.

    What killed consoles have left is removed first. Raises OSError.
    """
    folder = data / FOLDER
    make_private_folder(folder)
    remove_left(data)
    rights = rights_in(folder).file
    lock = _own_lock(folder, rights, opened)
    path = lock.with_suffix(SOCKET)
    path.unlink(missing_ok=True)
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    opened.callback(listening.close)
    with _short_socket_name(path) as name:
        listening.bind(name)
    opened.callback(_remove, path)
    path.chmod(rights)  # whatever the umask; before it listens, nobody can connect
    return listening


def remove_left(data: Path) -> None:
    """Remove the sockets that killed consoles have left, of this account or, in a shared folder, of its group."""
    with suppress(OSError):
        for lock in (data / FOLDER).glob(f"*{LOCK}"):
            descriptor = taken_if_left(lock)
            if descriptor is not None:
                _remove(lock.with_suffix(SOCKET))
                _remove(lock)
                os.close(descriptor)


def feeds(data: Path) -> list[Path]:
    """Return the sockets in a data folder, those of killed consoles too. Raises OSError: it is closed."""
    try:
        names = os.listdir(data / FOLDER)
    except (FileNotFoundError, NotADirectoryError):
        return []
    return [data / FOLDER / name for name in sorted(names) if name.endswith(SOCKET)]


def connect_feed(path: Path, timeout_s: float) -> socket.socket:
    """Return a connection to a feed, with this timeout for each operation. Raises OSError."""
    link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        link.settimeout(timeout_s)
        with _short_socket_name(path) as name:
            link.connect(name)
    except OSError:
        link.close()
        raise
    return link


def _own_lock(folder: Path, rights: int, opened: ExitStack) -> Path:
    for number in range(MOST_OF_A_PROCESS):
        name = f"{os.getpid()}-{number}" if number else f"{os.getpid()}"
        lock = folder / f"{name}{LOCK}"
        with suppress(FileExistsError):
            descriptor = made_locked(lock, rights)
            opened.callback(os.close, descriptor)
            opened.callback(_remove, lock)
            os.fchmod(descriptor, rights)
            return lock
    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(folder))


@contextmanager
def _short_socket_name(path: Path) -> Iterator[str]:
    """Yield a name of a socket that the system has room for, however long the path of its folder."""
    if len(os.fsencode(path)) <= LONGEST_PATH:
        yield str(path)
        return
    folder = os.open(path.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
