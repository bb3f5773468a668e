"""Marks of the runs that are going on: whoever is killed leaves his, and the next one tells of it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from profiles.files import PRIVATE_FILE, make_private_folder
from profiles.left_files import made_locked, taken_if_left

FOLDER = "running"


class RunMark:
    """The mark of a run that is going on, gone with its end."""

    def __init__(self, data: Path, run_id: str) -> None:
        """Put it into the data folder.

        Raises:
            OSError: it cannot be made.
        """
        self._path = data / FOLDER / run_id
        make_private_folder(self._path.parent)
        self._descriptor: int | None = made_locked(self._path, PRIVATE_FILE)
        with suppress(OSError):  # whatever the umask
            os.fchmod(self._descriptor, PRIVATE_FILE)

    def close(self) -> None:
        """Take it away."""
        if self._descriptor is not None:
            with suppress(OSError):
                self._path.unlink()
            os.close(self._descriptor)
            self._descriptor = None


@contextmanager
def left_runs(data: Path) -> Iterator[tuple[Path, ...]]:
    """Give the marks that killed ones have left; nobody else is given them meanwhile."""
    taken: list[int] = []
    paths: list[Path] = []
    try:
        found = sorted((data / FOLDER).iterdir())
    except OSError:  # it is made with the first run
        found = []
    try:
        for path in found:
            descriptor = taken_if_left(path)
            if descriptor is not None:
                taken.append(descriptor)
                paths.append(path)
        yield tuple(paths)
    finally:
        for descriptor in taken:
            os.close(descriptor)
