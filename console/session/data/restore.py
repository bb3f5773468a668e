"""Restore of a data folder from its backup: all of it or nothing, into a folder that is missing or empty.

The archive is read twice. First it is checked to its last byte, with nothing written; then it is unpacked beside
the data folder, and takes its place in one step. What a killed restore leaves, the next one removes.
"""

from __future__ import annotations

import errno
import fcntl
import gzip
import hashlib
import os
import re
import secrets
import shutil
import stat
import tarfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Self

from console.session.data.backup_format import (
    CONTENT,
    MANIFEST,
    MANIFEST_CAP_BYTES,
    SCHEMA,
    Manifest,
    OtherSchemaError,
    StoredFile,
    is_of_clone,
    is_safe,
    manifest_from,
)
from console.session.data.record_file import FILE_NAME
from console.session.data.record_schema import SCHEMA as RECORD_SCHEMA
from console.session.errors import SessionError
from profiles.fields import spell_toml
from profiles.files import make_private_folder, may_be_ours, open_regular, printable, rights_in, synchronise_folder
from profiles.problem import Problem

SPARE_BYTES = 1_000_000
CHUNK_BYTES = 1 << 20
MOST_ENTRIES = 600_000  # more than a manifest has room for
MOST_HEADER_BYTES = 100_000  # of an extended header: a path with its dates
PLAIN_FILES = (tarfile.REGTYPE, tarfile.AREGTYPE)
DAMAGE = (tarfile.TarError, zlib.error, EOFError, OSError, ValueError, MemoryError, RecursionError)
"""What reading raises of an archive that is none, or damaged."""

SQLITE_HEADER_BYTES, USER_VERSION = 100, slice(60, 64)  # of the SQLite file format


class _BoundedEntry(tarfile.TarInfo):
    @classmethod
    def frombuf(cls, buf: bytes | bytearray, encoding: str, errors: str) -> Self:
        """Return an entry; refuse one that says more about the next entry than `tarfile` should hold in memory."""
        entry = super().frombuf(buf, encoding, errors)
        if entry.type not in PLAIN_FILES and entry.size > MOST_HEADER_BYTES:
            raise tarfile.ReadError(f"a header of {entry.size} bytes")
        return entry


@dataclass(frozen=True, slots=True)
class Member:
    """An entry with a safe name: folder, file or manifest. `chunks` is its content, to be read at once."""

    path: str
    is_manifest: bool
    is_folder: bool
    modified_s: float
    chunks: Iterator[bytes]


def check_archive(archive: Path) -> Manifest:
    """Read an archive to its end, and return its manifest where everything in it is as the manifest says.

    Raises SessionError: `file.unreadable`, `restore.not_backup`, `restore.damaged`, `restore.unsafe`;
    `schema.unsupported`, `record.other_schema`.
    """
    entries = members(archive)
    try:
        return _compare_archive(archive, entries)
    except SessionError:
        # A damaged byte may look like another schema. What reveals it, the checksum, is at the end.
        for member in entries:
            for _ in member.chunks:
                pass
        raise


def _compare_archive(archive: Path, entries: Iterator[Member]) -> Manifest:
    files: dict[str, StoredFile] = {}
    folders: set[str] = set()
    manifest: Manifest | None = None
    for member in entries:
        above = {str(folder) for folder in PurePosixPath(member.path).parents}
        if manifest is not None or member.path in files or member.path in folders or above & files.keys():
            raise refusal("restore.unsafe", archive, value=printable(member.path))
        if member.is_manifest:
            manifest = _manifest_in(archive, member)
        elif member.is_folder:
            folders.add(member.path)
        else:
            files[member.path] = _read_archived_file(archive, member)
    if manifest is None:
        raise refusal("restore.not_backup", archive, value=f"no {MANIFEST}")
    wrong = {path for path in {*files, *manifest.files} if files.get(path) != manifest.files.get(path)}
    wrong |= folders ^ set(manifest.folders)
    if wrong:
        raise refusal("restore.damaged", archive, value=printable(min(wrong)))
    return manifest


def members(archive: Path) -> Iterator[Member]:
    """Yield the entries of an archive, read to its last byte; raises as `check_archive`."""
    with _open_archive(archive) as file:
        # Not tarfile's own reading of gzip, which does not compare the checksum at the end.
        with gzip.GzipFile(fileobj=file, mode="rb") as unzipped:
            with _naming_damage("restore.not_backup", archive):
                tar = tarfile.open(fileobj=unzipped, mode="r|", tarinfo=_BoundedEntry)
            for number in count():
                if number > MOST_ENTRIES:
                    raise refusal("restore.not_backup", archive, value=f"> {MOST_ENTRIES}")
                tar.members = []  # type: ignore[attr-defined]  # it would keep each of them
                with _naming_damage("restore.damaged", archive):
                    entry = tar.next()
                if entry is None:
                    break
                yield _member(archive, tar, entry)
            with _naming_damage("restore.damaged", archive):
                while unzipped.read(CHUNK_BYTES):
                    pass


def refusal(code: str, path: Path, *, key: str = "", value: str = "", limit: str = "") -> SessionError:
    """Return the refusal of an archive or a folder."""
    return SessionError(Problem(code=code, where=printable(str(path)), key=key, value=value, limit=limit))


def _member(archive: Path, tar: tarfile.TarFile, entry: tarfile.TarInfo) -> Member:
    is_file = entry.type in PLAIN_FILES and not entry.issparse()
    is_manifest = entry.name == MANIFEST and is_file
    path = MANIFEST if is_manifest else entry.name.removeprefix(CONTENT)
    known = is_manifest or (entry.name.startswith(CONTENT) and is_safe(path))
    if not known or not (is_file or entry.isdir()):
        raise refusal("restore.unsafe", archive, value=printable(entry.name))
    chunks = _chunks(archive, tar, entry)
    return Member(path, is_manifest, entry.isdir(), float(entry.mtime), chunks)


def _chunks(archive: Path, tar: tarfile.TarFile, entry: tarfile.TarInfo) -> Iterator[bytes]:
    with _naming_damage("restore.damaged", archive):
        source = tar.extractfile(entry)
    while source is not None:
        with _naming_damage("restore.damaged", archive):
            chunk = source.read(CHUNK_BYTES)
        if not chunk:
            return
        yield chunk


def _read_archived_file(archive: Path, member: Member) -> StoredFile:
    """Return size and hash of a file; refuse the records of a newer console."""
    digest, size, head = hashlib.sha256(), 0, b""
    for chunk in member.chunks:
        digest.update(chunk)
        size += len(chunk)
        head = (head + chunk[:SQLITE_HEADER_BYTES])[:SQLITE_HEADER_BYTES]
    version = int.from_bytes(head[USER_VERSION])
    if member.path == FILE_NAME and version > RECORD_SCHEMA:
        raise refusal("record.other_schema", archive, value=str(version), limit=str(RECORD_SCHEMA))
    return StoredFile(size, digest.hexdigest())


def _manifest_in(archive: Path, member: Member) -> Manifest:
    content = b""
    for chunk in member.chunks:
        content += chunk
        if len(content) > MANIFEST_CAP_BYTES:
            raise refusal("restore.not_backup", archive, value=f"{MANIFEST} > {MANIFEST_CAP_BYTES} bytes")
    try:
        return manifest_from(content)
    except OtherSchemaError as error:
        found = spell_toml(error.args[0])
        raise refusal("schema.unsupported", archive, key="schema", value=found, limit=str(SCHEMA)) from error
    except ValueError as error:
        raise refusal("restore.not_backup", archive, value=printable(f"{MANIFEST}: {error}")) from error


@contextmanager
def _open_archive(archive: Path) -> Iterator[BinaryIO]:
    try:
        file = open(archive, "rb", opener=open_regular)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise refusal("file.unreadable", archive, value=reason) from error
    with file:
        yield file


@contextmanager
def _naming_damage(code: str, archive: Path) -> Iterator[None]:
    try:
        yield
    except DAMAGE as error:
        raise refusal(code, archive, value=printable(str(error) or type(error).__name__)) from error


def restore(archive: Path, data: Path) -> tuple[Manifest, tuple[Problem, ...]]:
    """Restore a backup into the data folder, which must be missing or empty; return what it held, without clones.

    Clones of git in an archive are left out (`restore.left_out`): git runs what is in them.

    Raises:
        SessionError: as `check_archive`; `restore.not_empty`, `restore.no_space`, `restore.not_writable`. Nothing
        is in
            the data folder then.
    """
    data = data.resolve()
    _refuse_filled(data)
    manifest = check_archive(archive)
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
