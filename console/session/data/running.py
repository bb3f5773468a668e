"""Marks of active runs: a killed console leaves its mark, and the next start reports it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from profiles.files import PRIVATE_FILE, made_locked, make_private_folder, taken_if_left

FOLDER = "running"


class RunMark:
    """Mark of an active run, removed at its end."""

    def __init__(self, data: Path, run_id: str) -> None:
        """Create the mark in the data folder.

        Raises:
            OSError: it cannot be made.
        """
        self._path = data / FOLDER / run_id
        make_private_folder(self._path.parent)
        self._descriptor: int | None = made_locked(self._path, PRIVATE_FILE)
        with suppress(OSError):  # whatever the umask
            os.fchmod(self._descriptor, PRIVATE_FILE)

    def close(self) -> None:
        """Remove the mark."""
        if self._descriptor is not None:
            with suppress(OSError):
                self._path.unlink()
            os.close(self._descriptor)
            self._descriptor = None


@contextmanager
def left_runs(data: Path) -> Iterator[tuple[Path, ...]]:
    """Yield the marks that killed runs have left, locked against other consoles."""
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
