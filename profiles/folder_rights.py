"""Rights of our own files: they follow the folder, not the umask of whoever writes.

A folder with the setgid bit that its group may write, and not everybody (`install -d -m 2770 -g GROUP`), is
shared: all accounts of its group work with what is in it. Anything else is private to its owner.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Rights:
    """Permissions of new folders and new files."""

    folder: int
    file: int

    @property
    def shared(self) -> bool:
        """Whether the group has the same rights as the owner."""
        return bool(self.file & stat.S_IWGRP)


PRIVATE = Rights(folder=0o700, file=0o600)
SHARED = Rights(folder=0o2770, file=0o660)


def rights_in(folder: Path) -> Rights:
    """Return the rights of new files and folders in a folder, which need not exist yet.

    A subfolder that somebody made by hand in a shared folder has inherited the setgid bit, though not always the
    right to write: it counts as the folder that it is in. One that is closed to its group is private.
    """
    for each in (folder, *folder.absolute().parents):
        try:
            mode = os.stat(each).st_mode
        except FileNotFoundError:
            continue
        except OSError:
            return PRIVATE
        if is_shared(mode):
            return SHARED
        if not mode & stat.S_ISGID or not mode & stat.S_IXGRP or mode & stat.S_IWOTH:
            return PRIVATE
    return PRIVATE


def is_shared(mode: int) -> bool:
    """Whether a folder of this mode is shared within its group."""
    return bool(mode & stat.S_ISGID and mode & stat.S_IWGRP and not mode & stat.S_IWOTH)


def may_be_ours(status: os.stat_result, folder: Path) -> bool:
    """Whether a file in a folder was written by this account, or by another one that shares the folder."""
    if status.st_uid == os.geteuid():
        return True
    try:
        return rights_in(folder).shared and status.st_gid == os.stat(folder).st_gid
    except OSError:
        return False
