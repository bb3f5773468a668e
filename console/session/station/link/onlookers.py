"""How many consoles of one data folder look on at a machine, for the console that controls it.

An observer writes nothing into the controller. Each holds a place in a file of the data folder, which the system
takes back when its process ends; the controlling console counts the places that are held. Consoles with other data
folders are not counted. A thread of its own does this, since a disk that hangs may hold up no poll.
"""

from __future__ import annotations

import fcntl
import os
import threading
from pathlib import Path

from console.session.station.machine_control import lock_path, open_lock

PLACES = 16
EVERY_S = 2.0


class Onlookers:
    """The places at one machine. `count` is how many others hold one, 0 while this console looks on itself."""

    def __init__(self, data: Path, address: str) -> None:
        self.count = 0
        self._path = lock_path(data, address).with_suffix(".observers")
        self._descriptor: int | None = None
        self._place: int | None = None
        self._looks_on = False
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def say(self, *, looks_on: bool) -> None:
        """Say whether this console looks on; returns at once."""
        self._looks_on = looks_on
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="onlookers", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Give the place up with the process."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                self.see()
            except OSError:  # then nobody is counted: nothing depends on it
                self.count = 0
            self._ended.wait(EVERY_S)
        if self._descriptor is not None:
            os.close(self._descriptor)

    def see(self) -> None:
        """Take a place, or give it up, and count. Raises OSError."""
        if self._descriptor is None:
            self._descriptor = open_lock(self._path)
        if not self._looks_on:
            if self._place is not None:
                fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, self._place)
                self._place = None
            self.count = sum(not self._is_free(place) for place in range(PLACES))
        elif self._place is None:
            self.count = 0
            self._place = next((place for place in range(PLACES) if self._takes(place)), None)

    def _is_free(self, place: int) -> bool:
        taken = self._takes(place)
        if taken:
            assert self._descriptor is not None
            fcntl.lockf(self._descriptor, fcntl.LOCK_UN, 1, place)
        return taken

    def _takes(self, place: int) -> bool:
        assert self._descriptor is not None
        try:
            fcntl.lockf(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
        except (BlockingIOError, PermissionError):
            return False
        return True
