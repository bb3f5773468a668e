"""State of the data folder on its file system: whose it is, who may use it, what in it is closed to others."""

from __future__ import annotations

import grp
import os
import pwd
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from profiles.files import SHARED, is_shared, walk

LITTLE_BYTES = 200_000_000
"""Below this much free space: some hundred run records, or a few hundred traces."""

SKIPPED = ".git"
"""Folder whose files have rights of their own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderState:
    """`mode` are the permission bits, `free_bytes` what this account may still write.

    `closed` are paths in a shared folder that its group cannot use, or in a private one that this account cannot.
    """

    path: Path
    owner: str
    group: str
    mode: int
    free_bytes: int
    usable: bool
    closed: tuple[Path, ...]

    @property
    def rights(self) -> str:
        """Permissions as `ls` shows them, with owner and group."""
        return f"{stat.filemode(stat.S_IFDIR | self.mode)} {self.owner}:{self.group}"

    @property
    def free_space(self) -> str:
        """Free space with its unit."""
        return f"{self.free_bytes / 1e9:.1f} GB"

    @property
    def shared(self) -> bool:
        """Whether all accounts of its group work with it."""
        return is_shared(self.mode)


def state_of(data: Path) -> FolderState | None:
    """Return the state of the data folder, None where it does not exist yet. Raises OSError."""
    try:
        status = os.stat(data)
    except FileNotFoundError:
        return None
    room = os.statvfs(data)
    mode = stat.S_IMODE(status.st_mode)
    usable = stat.S_ISDIR(status.st_mode) and os.access(data, os.R_OK | os.W_OK | os.X_OK)
    return FolderState(
        path=data,
        owner=_name_of_number(lambda: pwd.getpwuid(status.st_uid).pw_name, status.st_uid),
        group=_name_of_number(lambda: grp.getgrgid(status.st_gid).gr_name, status.st_gid),
        mode=mode,
        free_bytes=room.f_bavail * room.f_frsize,
        usable=usable,
        closed=tuple(_find_closed_entries(data, status.st_gid if is_shared(mode) else None)) if usable else (),
    )


def _find_closed_entries(data: Path, group: int | None) -> Iterator[Path]:
    for folder, folders, files in walk(data):
        folders[:] = sorted(name for name in folders if name != SKIPPED)
        for name in (*folders, *sorted(files)):
            path = Path(folder, name)
            try:
                status = path.lstat()
            except OSError:  # removed meanwhile
                continue
            if stat.S_ISLNK(status.st_mode):
                continue
            needed = SHARED.folder if stat.S_ISDIR(status.st_mode) else SHARED.file
            needed &= stat.S_IRWXG | stat.S_ISGID
            open_to_group = status.st_gid == group and status.st_mode & needed == needed
            if not (open_to_group if group is not None else os.access(path, os.R_OK | os.W_OK)):
                yield path


def _name_of_number(name_of: Callable[[], str], number: int) -> str:
    try:
        return name_of()
    except KeyError:  # an account of another computer
        return str(number)
