"""The log of the program in the data folder: what was called, how it ended, and what went wrong inside.

It rotates, and several processes may write to it. Nothing waits for it: a line that cannot be written is lost. A
folder that is not there is not made for it.
"""

from __future__ import annotations

import fcntl
import logging
import os
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from io import TextIOWrapper
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import NoReturn

from console.escaping import escape_text
from profiles.files import make_private_folder, open_regular, rights_in

FOLDER, FILE, LOCK = "program-log", "trilobe.log", "lock"
MOST_BYTES, KEPT_FILES = 1_000_000, 5
WAIT_S, LOOK_S = 0.2, 0.01  # for another process that writes

_FORM = "%(asctime)s.%(msecs)03dZ %(levelname)-7s %(process)d %(message)s"


def note(data: Path, text: str, *, level: int = logging.INFO, error: BaseException | None = None) -> None:
    """Add a line, with the traceback of an error; returns soon, whatever happens."""
    with suppress(OSError, ValueError):
        if not data.is_dir():
            return
        folder = data / FOLDER
        make_private_folder(folder)
        raised = None if error is None else (type(error), error, error.__traceback__)
        record = logging.LogRecord("trilobe", level, "", 0, "%s", (text,), raised)
        with _lock_log(folder):
            with closing(_Handler(folder / FILE)) as handler:
                handler.emit(record)


class _Handler(RotatingFileHandler):
    def __init__(self, path: Path) -> None:
        super().__init__(
            path, maxBytes=MOST_BYTES, backupCount=KEPT_FILES, encoding="utf-8", errors="backslashreplace"
        )
        self.setFormatter(_LogFormatter(_FORM, "%Y-%m-%dT%H:%M:%S"))

    def _open(self) -> TextIOWrapper:
        """Open the log, with the rights of its folder; a link, a pipe or a device in its place is not used."""
        return open(self.baseFilename, "a", encoding=self.encoding, errors=self.errors, opener=_open_log)

    def handleError(self, record: logging.LogRecord) -> NoReturn:  # noqa: N802 - the name is that of logging
        """Raise what logging would write to the terminal of the operator."""
        raise


class _LogFormatter(logging.Formatter):
    converter = staticmethod(time.gmtime)

    def format(self, record: logging.LogRecord) -> str:
        """Return the line; names in it neither steer a terminal nor begin a line of their own."""
        return escape_text(super().format(record).replace("\n", "\n    "))


def _open_log(path: str | Path, flags: int) -> int:
    rights = rights_in(Path(path).parent).file
    descriptor = open_regular(path, flags | os.O_NOFOLLOW, rights)
    with suppress(OSError):
        os.fchmod(descriptor, rights)  # whatever the umask; of another account otherwise
    return descriptor


@contextmanager
def _lock_log(folder: Path) -> Iterator[None]:
    """Hold the lock of the log, but do not wait long for a process that has been halted with it."""
    descriptor = _open_log(folder / LOCK, os.O_RDWR | os.O_CREAT)
    try:
        until_s = time.monotonic() + WAIT_S
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > until_s:
                    raise
                time.sleep(LOOK_S)
        yield
    finally:
        os.close(descriptor)
