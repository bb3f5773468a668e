"""Backup of the data folder, also while consoles write to it: whole files, and the records of one moment."""

from __future__ import annotations

import gzip
import hashlib
import io
import os
import secrets
import sqlite3
import tarfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO

from console.session.data.backup_format import (
    CONTENT,
    MANIFEST,
    FolderEntry,
    Manifest,
    StoredFile,
    entries_of,
    manifest_text,
)
from console.session.data.kept_files import file_error, utc_now
from console.session.data.record_file import FILE_NAME, is_damage, opened_to_read, record_error, retrying
from console.session.errors import SessionError
from profiles.files import made_locked, open_regular, printable, written_atomically
from profiles.problem import Problem

WAIT_S = 5.0
"""How long to wait for a writer of the records."""


def back_up(data: Path, archive: Path) -> tuple[Manifest, tuple[Problem, ...]]:
    """Write a backup of the data folder to a new file; return what is in it, and what was left out.

    Links, pipes, sockets, devices and clones of git are left out (`backup.left_out`): a backup holds data.

    Raises:
        SessionError: `backup.nothing`, `backup.inside`; `record.damaged`, `backup.records`.
        ProfileError: `file.exists`, `file.not_writable`; `file.unreadable` for a file in the data folder.
    """
    if not data.is_dir():
        raise SessionError(Problem(code="backup.nothing", where=printable(str(data))))
    if data.resolve() in archive.resolve().parents:
        raise SessionError(
            Problem(code="backup.inside", where=printable(str(archive)), limit=printable(str(data)))
        )
    left_out: list[Problem] = []
    with written_atomically(archive, overwrite=False, private=True) as file:
        with (
            gzip.GzipFile(filename="", fileobj=file, mode="wb", compresslevel=6) as zipped,
            tarfile.open(fileobj=zipped, mode="w|", format=tarfile.PAX_FORMAT) as tar,
        ):
            manifest = _write_archive(tar, data, archive.resolve(), left_out)
    return manifest, tuple(left_out)


def _write_archive(tar: tarfile.TarFile, data: Path, archive: Path, left_out: list[Problem]) -> Manifest:
    files: dict[str, StoredFile] = {}
    folders: list[str] = []
    for entry in _entries(data):
        if not entry.is_kept:
            left_out.append(Problem(code="backup.left_out", where=printable(str(data / entry.path))))
        elif entry.is_folder:
            folders.append(entry.path)
            tar.addfile(_information(entry, data, tarfile.DIRTYPE))
        else:
            with _open_entry(data, entry, archive) as source:
                if source is not None:
                    files[entry.path] = _add_file(tar, entry, data, source)
    software = f"trilobe {version('trilobe')}"
    manifest = Manifest(files=files, folders=tuple(folders), software=software, created_utc=utc_now())
    content = manifest_text(manifest)
    information = tarfile.TarInfo(MANIFEST)
    information.size, information.mode, information.mtime = len(content), 0o600, int(time.time())
    tar.addfile(information, io.BytesIO(content))
    return manifest


def _entries(data: Path) -> Iterator[FolderEntry]:
    try:
        yield from entries_of(data)
    except OSError as error:
        raise file_error("file.unreadable", Path(error.filename or data), error) from error


def _information(entry: FolderEntry, data: Path, kind: bytes) -> tarfile.TarInfo:
    """Return the header of an entry: no owner and no rights, which follow the folder that it is restored to."""
    information = tarfile.TarInfo(CONTENT + entry.path)
    information.type, information.mode = kind, 0o700 if kind == tarfile.DIRTYPE else 0o600
    return information


def _add_file(tar: tarfile.TarFile, entry: FolderEntry, data: Path, source: BinaryIO) -> StoredFile:
    status = os.fstat(source.fileno())
    information = _information(entry, data, tarfile.REGTYPE)
    information.size, information.mtime = status.st_size, status.st_mtime
    reader = _HashedReader(source, data / entry.path, status.st_size)
    tar.addfile(information, reader)  # type: ignore[arg-type]
    return StoredFile(status.st_size, reader.digest.hexdigest())


class _HashedReader:
    """Read exactly as many bytes as a file had when it was opened, and hash them; a log may grow meanwhile."""

    def __init__(self, file: BinaryIO, path: Path, size: int) -> None:
        self.digest = hashlib.sha256()
        self._file, self._path, self._left = file, path, size

    def read(self, size: int) -> bytes:
        """Return the next bytes. ProfileError `file.unreadable`: they cannot be read, or the file has been cut."""
        try:
            content = self._file.read(min(size, self._left))
            if not content and self._left:
                raise OSError("cut short meanwhile")
        except OSError as error:
            raise file_error("file.unreadable", self._path, error) from error
        self._left -= len(content)
        self.digest.update(content)
        return content


@contextmanager
def _open_entry(data: Path, entry: FolderEntry, archive: Path) -> Iterator[BinaryIO | None]:
    """Open a file of the data folder; None where it has been removed meanwhile. Of the records, a copy."""
    path = data / entry.path
    if entry.path == FILE_NAME:
        with _temporary_file(archive) as copy:
            _copy_records(path, copy)
            with copy.open("rb") as file:
                yield file
        return
    try:
        # Neither follows a link nor waits for a pipe that was put there meanwhile.
        descriptor = open_regular(path, os.O_RDONLY | os.O_NOFOLLOW)
    except FileNotFoundError:
        yield None
        return
    except OSError as error:
        raise file_error("file.unreadable", path, error) from error
    with os.fdopen(descriptor, "rb") as file:
        yield file


@contextmanager
def _temporary_file(archive: Path) -> Iterator[Path]:
    """Yield an empty temporary file on the disk of the archive: the one for temporary files may be small.

    It is named and locked as that of a writer, so that the next backup removes what a killed one has left.
    """
    path = archive.with_name(f".{archive.name}.{secrets.token_hex(4)}.tmp")
    descriptor = made_locked(path, 0o600)
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)


def _copy_records(path: Path, copy: Path) -> None:
    """Copy the records as they are at one moment, with what is only in the journal yet; refuse damaged ones."""
    try:
        with (
            closing(opened_to_read(path, WAIT_S)) as source,
            closing(sqlite3.connect(copy, isolation_level=None)) as target,
        ):
            target.execute("PRAGMA synchronous=OFF")  # nobody needs the copy after a power cut
            retrying(lambda: source.backup(target), time.monotonic() + WAIT_S)
            target.execute("PRAGMA journal_mode=DELETE")  # one file, without a journal beside it
            (found,) = target.execute("PRAGMA integrity_check(1)").fetchone()
    except sqlite3.Error as error:
        raise record_error("record.damaged" if is_damage(error) else "backup.records", path, error) from error
    if found != "ok":
        raise record_error("record.damaged", path, " ".join(str(found).split()))
