"""A name of our own for a pseudo-terminal: its own one the system gives to somebody else when it is gone."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

FOLDER, NAME = "trilobe-", "pmac"


class StableName:
    """A symbolic link in a temporary folder that only its owner may look into."""

    def __init__(self) -> None:
        """Make the folder.

        Raises:
            OSError: it cannot be done.
        """
        self.path = os.path.join(tempfile.mkdtemp(prefix=FOLDER), NAME)

    def point_at(self, device: str) -> None:
        """Lead to a device, at no time to nothing where it has led to one before.

        Raises:
            OSError: it cannot be done.
        """
        fresh = f"{self.path}.new"
        os.symlink(device, fresh)
        os.replace(fresh, self.path)

    def withdraw(self) -> None:
        """Lead nowhere."""
        with suppress(OSError):
            os.unlink(self.path)


def remove_name(path: str) -> None:
    """Remove a name with its folder, also one that a process has left behind when it died; nothing else."""
    name = Path(path)
    if name.name == NAME and name.parent.name.startswith(FOLDER):
        with suppress(OSError):
            if name.is_symlink():
                name.unlink()
            name.parent.rmdir()
