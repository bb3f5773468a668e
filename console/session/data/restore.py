"""Restore of a data folder from its backup: all of it or nothing, into a folder that is missing or empty.

The archive is read twice. First it is checked to its last byte, with nothing written; then it is unpacked beside
the data folder, and takes its place in one step. What a killed restore leaves, the next one removes.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from console.session.data.backup_format import Manifest, is_of_clone
from console.session.data.backup_reading import Member, checked, members, refusal
from profiles.files import make_private_folder, printable, synchronise_folder
from profiles.folder_rights import may_be_ours, rights_in
from profiles.problem import Problem

SPARE_BYTES = 1_000_000


def restore(archive: Path, data: Path) -> tuple[Manifest, tuple[Problem, ...]]:
    """Restore a backup into the data folder, which must be missing or empty; return what it held, without clones.

    Clones of git, which older consoles packed, are left out (`restore.left_out`): git runs what is in them.

    Raises:
        SessionError: as `checked`; `restore.not_empty`, `restore.no_space`, `restore.not_writable`. Nothing is in
            the data folder then.
    """
    data = data.resolve()
    _refuse_filled(data)
    manifest = checked(archive)
    try:
        make_private_folder(data.parent)
        _remove_left(data)
        _refuse_full(data.parent, manifest)
        with _stage(data) as stage:
            for member in members(archive):
                if not member.is_manifest and not is_of_clone(member.path):
                    _unpack(archive, member, stage, manifest)
            _settle(stage, data)
    except OSError as error:
        if error.errno in (errno.ENOTEMPTY, errno.EEXIST):  # filled meanwhile
            raise refusal("restore.not_empty", data) from error
        value = error.strerror or str(error)
        raise refusal("restore.not_writable", data.parent, key=printable(str(data)), value=value) from error
    files = {path: stored for path, stored in manifest.files.items() if not is_of_clone(path)}
    clones = sorted(path for path in {*manifest.files, *manifest.folders} if is_of_clone(path))
    tops = (path for path in clones if not is_of_clone(os.path.dirname(path)))
    left_out = tuple(Problem(code="restore.left_out", where=printable(str(data / path))) for path in tops)
    return replace(manifest, files=files), left_out


def _refuse_filled(data: Path) -> None:
    try:
        with os.scandir(data) as entries:
            filled = any(entries)
    except FileNotFoundError:
        return
    except OSError as error:
        raise refusal("file.unreadable", data, value=error.strerror or str(error)) from error
    if filled:
        raise refusal("restore.not_empty", data)


def _refuse_full(folder: Path, manifest: Manifest) -> None:
    needed, room = manifest.total_bytes + SPARE_BYTES, os.statvfs(folder)
    free = room.f_bavail * room.f_frsize
    if free < needed:
        value, limit = f"{free / 1e6:.0f} MB", f"{needed / 1e6:.0f} MB"
        raise refusal("restore.no_space", folder, value=value, limit=limit)


@contextmanager
def _stage(data: Path) -> Iterator[Path]:
    """Yield a new locked folder beside the data folder, with its rights; removed unless it was moved."""
    stage = data.with_name(f".{data.name}.{secrets.token_hex(4)}.restore")
    os.mkdir(stage, 0o700)
    descriptor = os.open(stage, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if data.exists():
            status = data.stat()
            own = os.stat(stage)
            if (status.st_uid, status.st_gid) != (own.st_uid, own.st_gid):
                os.chown(stage, status.st_uid if os.geteuid() == 0 else -1, status.st_gid)
            os.chmod(stage, stat.S_IMODE(status.st_mode))
        else:
            os.chmod(stage, rights_in(data.parent).folder)
        yield stage
    finally:
        os.close(descriptor)
        shutil.rmtree(stage, ignore_errors=True)


def _unpack(archive: Path, member: Member, stage: Path, manifest: Manifest) -> None:
    """Write one entry; `restore.damaged` where it is no longer what was checked."""
    path = stage / member.path
    if member.is_folder:
        make_private_folder(path)
        return
    make_private_folder(path.parent)
    mode, digest = rights_in(path.parent).file, hashlib.sha256()
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode)
    with os.fdopen(descriptor, "wb") as file:
        os.fchmod(descriptor, mode)
        for chunk in member.chunks:
            file.write(chunk)
            digest.update(chunk)
        file.flush()
        os.fsync(descriptor)
    stored = manifest.files.get(member.path)
    if stored is None or digest.hexdigest() != stored.sha256:
        raise refusal("restore.damaged", archive, value=printable(member.path))
    with suppress(OverflowError):  # the order of traces is that of their dates
        os.utime(path, (member.modified_s, member.modified_s))


def _settle(stage: Path, data: Path) -> None:
    """Give everything to the owner of the stage, and put it in the place of the data folder."""
    owner = os.stat(stage)
    for folder, _, files in os.walk(stage):
        for name in files if os.geteuid() == 0 else ():
            os.chown(os.path.join(folder, name), owner.st_uid, -1)
        if os.geteuid() == 0:
            os.chown(folder, owner.st_uid, -1)
        synchronise_folder(Path(folder))
    os.rename(stage, data)
    synchronise_folder(data.parent)


def _remove_left(data: Path) -> None:
    """Remove what killed restores of this folder have left beside it."""
    pattern = re.compile(rf"\.{re.escape(data.name)}\.[0-9a-f]{{8}}\.restore")
    for path in data.parent.iterdir():
        if pattern.fullmatch(path.name) is None:
            continue
        with suppress(OSError):
            descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # one that is at work holds it
                if may_be_ours(os.fstat(descriptor), data.parent):
                    shutil.rmtree(path)
            finally:
                os.close(descriptor)
