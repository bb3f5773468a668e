"""Reading of a backup, entry by entry, with nothing trusted: names, types, sizes and the archive itself."""

from __future__ import annotations

import gzip
import hashlib
import tarfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
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
    Stored,
    is_safe,
    manifest_from,
)
from console.session.data.record_file import FILE_NAME
from console.session.data.record_schema import SCHEMA as RECORD_SCHEMA
from console.session.errors import SessionError
from profiles.fields import spelled
from profiles.files import open_regular, printable
from profiles.problem import Problem

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


def checked(archive: Path) -> Manifest:
    """Read an archive to its end, and return its manifest where everything in it is as the manifest says.

    Raises SessionError: `file.unreadable`, `restore.not_backup`, `restore.damaged`, `restore.unsafe`;
    `schema.unsupported`, `record.other_schema`.
    """
    entries = members(archive)
    try:
        return _compared(archive, entries)
    except SessionError:
        # A damaged byte may look like another schema. What reveals it, the checksum, is at the end.
        for member in entries:
            for _ in member.chunks:
                pass
        raise


def _compared(archive: Path, entries: Iterator[Member]) -> Manifest:
    files: dict[str, Stored] = {}
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
            files[member.path] = _stored(archive, member)
    if manifest is None:
        raise refusal("restore.not_backup", archive, value=f"no {MANIFEST}")
    wrong = {path for path in {*files, *manifest.files} if files.get(path) != manifest.files.get(path)}
    wrong |= folders ^ set(manifest.folders)
    if wrong:
        raise refusal("restore.damaged", archive, value=printable(min(wrong)))
    return manifest


def members(archive: Path) -> Iterator[Member]:
    """Yield the entries of an archive, read to its last byte; raises as `checked`."""
    with _opened(archive) as file:
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


def _stored(archive: Path, member: Member) -> Stored:
    """Return size and hash of a file; refuse the records of a newer console."""
    digest, size, head = hashlib.sha256(), 0, b""
    for chunk in member.chunks:
        digest.update(chunk)
        size += len(chunk)
        head = (head + chunk[:SQLITE_HEADER_BYTES])[:SQLITE_HEADER_BYTES]
    version = int.from_bytes(head[USER_VERSION])
    if member.path == FILE_NAME and version > RECORD_SCHEMA:
        raise refusal("record.other_schema", archive, value=str(version), limit=str(RECORD_SCHEMA))
    return Stored(size, digest.hexdigest())


def _manifest_in(archive: Path, member: Member) -> Manifest:
    content = b""
    for chunk in member.chunks:
        content += chunk
        if len(content) > MANIFEST_CAP_BYTES:
            raise refusal("restore.not_backup", archive, value=f"{MANIFEST} > {MANIFEST_CAP_BYTES} bytes")
    try:
        return manifest_from(content)
    except OtherSchemaError as error:
        found = spelled(error.args[0])
        raise refusal("schema.unsupported", archive, key="schema", value=found, limit=str(SCHEMA)) from error
    except ValueError as error:
        raise refusal("restore.not_backup", archive, value=printable(f"{MANIFEST}: {error}")) from error


@contextmanager
def _opened(archive: Path) -> Iterator[BinaryIO]:
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
