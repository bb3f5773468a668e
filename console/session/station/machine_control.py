"""Control of the machine: one console of this computer at a time, with a log of every change of control.

The kernel releases the lock when its process dies, so a lock that can be taken means that its holder is gone; the
number left in it tells whether the controller is still held by that console.

Lock and log may have been replaced by somebody else: nothing is opened through a symbolic link, and nothing is
written to anything but a plain file of this user, or in a shared folder of its group.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from console.session.errors import SessionError
from console.session.terminal_place import signed_host
from drivers.errors import RefusedError
from drivers.lathe.console_role import NOBODY
from drivers.lathe.lathe import Lathe
from profiles.files import make_private_file, make_private_folder, may_be_ours, open_regular
from profiles.problem import Problem

FOREIGN = "not a plain file of this user"

LOG_NAME = "ownership.log"


class MachineControl:
    """Control of the machine at one address, from one console."""

    def __init__(
        self,
        lathe: Lathe,
        address: str,
        data: Path,
        lock: Callable[[], ConsoleLock | None] | None = None,
        *,
        name: str = "",
        client: str = "",
    ) -> None:
        """Take `lock`, which takes the lock of this computer; None: nobody else can reach the machine.

        With the `name` of an operator, each claim is signed in the controller; `client` is where a terminal comes
        from that is not at this computer.
        """
        self._lathe, self._address, self._data, self._take_lock = lathe, address, data, lock
        self._name, self._client = name, client
        self._lock: ConsoleLock | None = None

    def claim(self) -> None:
        """Become the owner, also in place of a dead console of this computer.

        Raises:
            RefusedError: `owner.held`, `owner.beside`; this console only observes.
            SessionError: `lock.unwritable`.
            LinkError: the link broke.
        """
        self._lock_here()
        if self._lock is None and self._take_lock is not None:
            raise RefusedError(Problem(code="owner.beside", where=self._address))
        try:
            self._lathe.claim()
        except RefusedError:
            lock, ownership = self._lock, self._lathe.ownership
            if lock is None or ownership is None or lock.last_number != ownership.holder:
                self._let_go()
                raise
            self._log("in the place of a console that died", self._lathe.take_control())
        self._keep()

    def take_control(self) -> None:
        """Take control of the machine from its owner, at rest.

        Raises:
            RefusedError: `owner.moving`.
            SessionError: `lock.unwritable`.
            LinkError: the link broke.
        """
        self._lock_here()
        self._log("taken over", self._lathe.take_control())
        self._keep()

    def release(self) -> None:
        """Release control of the machine."""
        self._lathe.release()
        self._let_go()

    def _let_go(self) -> None:
        """Release the lock: an observer keeps nobody else from the machine."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def _lock_here(self) -> None:
        if self._lock is None and self._take_lock is not None:
            self._lock = self._take_lock()

    @property
    def _number(self) -> int:
        return NOBODY if self._lathe.ownership is None else self._lathe.ownership.number

    def _keep(self) -> None:
        """Leave the number in the lock, for the next console, and the name in the controller, for observers."""
        if self._name:
            host = signed_host(self._client, socket.gethostname().partition(".")[0])
            self._lathe.sign(self._name, host, int(time.time() // 60))
        if self._lock is not None and self._lathe.ownership is not None:
            self._lock.keep(self._number)

    def _log(self, what: str, before: int) -> None:
        """Add a line to the log; a write failure has no effect on the machine."""
        path, at = self._data / LOG_NAME, datetime.now(UTC).isoformat(timespec="seconds")
        with suppress(OSError):
            make_private_folder(self._data)
            make_private_file(path)
            descriptor = open_regular(path, os.O_WRONLY | os.O_APPEND | os.O_NOFOLLOW)
            with open(descriptor, "a", encoding="utf-8") as log:
                log.write(f"{at} {self._address} {what}: console {before} -> console {self._number}\n")


@dataclass(frozen=True, slots=True)
class ConsoleLock:
    """A lock that was taken. `last_number` is that of the console that had it before, 0 for none."""

    _descriptor: int
    last_number: int

    def keep(self, number: int) -> None:
        """Write the number of this console for the next one, if there is disk space."""
        with suppress(OSError):
            os.ftruncate(self._descriptor, 0)
            os.pwrite(self._descriptor, f"{number}\n".encode("ascii"), 0)

    def close(self) -> None:
        """Release the lock."""
        os.close(self._descriptor)


def take_lock(data: Path, address: str) -> ConsoleLock | None:
    """Take the lock of the machine at an address; None while another console of this data folder holds it.

    Connection options (`?stop=`, `?baud=`) do not make it another machine.

    Raises:
        SessionError: `lock.unwritable`.
    """
    path = lock_path(data, address)
    descriptor: int | None = None
    try:
        descriptor = open_lock(path)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if descriptor is not None:
            os.close(descriptor)
        if isinstance(error, BlockingIOError):
            return None
        value = error.strerror or str(error)
        raise SessionError(Problem(code="lock.unwritable", where=str(path), value=value)) from error
    left = os.pread(descriptor, 32, 0).strip()  # any other content than a number counts as none
    return ConsoleLock(descriptor, int(left) if left.isdigit() else 0)


def lock_path(data: Path, address: str) -> Path:
    """Return the file of the lock of the machine at an address."""
    place = address.rpartition("?")[0] or address
    return data / "locks" / f"{re.sub(r'[^A-Za-z0-9.-]+', '_', place)}.lock"


def open_lock(path: Path) -> int:
    """Open the lock file, creating it if it is missing; OSError unless it is a plain file of ours alone."""
    make_private_folder(path.parent)
    if path.parent.is_symlink() or path.is_symlink():
        raise OSError(errno.ELOOP, FOREIGN)
    make_private_file(path)
    descriptor = open_regular(path, os.O_RDWR | os.O_NOFOLLOW)
    status = os.fstat(descriptor)
    if not may_be_ours(status, path.parent) or status.st_nlink > 1:
        os.close(descriptor)
        raise OSError(errno.EPERM, FOREIGN)
    return descriptor
