"""All disk access of this package: regular files in, regular files out.

A path may name anything: a folder, a pipe without a writer, an endless device. Each of these becomes one
`Problem`, none of them blocks. Writing replaces a file atomically, so that a reader (or a power cut) finds the old
bytes or the new ones, never half of them. A running writer holds a lock on its temporary file, which the kernel
releases when the process ends, however it ends. So a file that can be locked was left by a killed one, whatever
its date; on a file system without locks none counts as left.

Rights of our own files follow the folder, not the umask of whoever writes. A folder with the setgid bit that its
group may write, and not everybody (`install -d -m 2770 -g GROUP`), is shared: all accounts of its group work with
what is in it. Anything else is private to its owner.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from profiles.problem import refusal_error


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


TOML_CAP_BYTES = 1_000_000
# Far above any honest line. The time of `tomllib` grows with the square of a dotted key's length.
TOML_LINE_CAP_CHARACTERS = 4096
TOML_LINE_CAP_DOTS = 100
MOST_DEPTH = 40
"""Folders above a file; Python itself lists and removes deeper ones by calling itself as often."""

NOT_REGULAR = "not a regular file"
_NUL_PART = 4  # a text of numbers and English in UTF-16 is half NUL bytes
TOML_LINE_SHOWN = 40  # characters of a line that cannot be read
_TOML_PLACE = re.compile(r"at line (\d+), column (\d+)")
_STATED_TWICE = re.compile(r"Cannot (declare|overwrite|redefine|mutate)|Duplicate")

_TEMPORARY = re.compile(r"\.(.+)\.[0-9a-f]{8}\.tmp", re.DOTALL)


def printable(text: str, most_characters: int = 200) -> str:
    """Return `text` on one line, with control characters escaped and the rest beyond the cap cut off."""
    cut = text if len(text) <= most_characters else text[: most_characters - 1] + "…"
    if cut.isprintable():  # as nearly every name is
        return cut
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in cut)


def open_regular(path: str | Path, flags: int = os.O_RDONLY, mode: int = 0o666) -> int:
    """Return a descriptor of a regular file; also an `opener` of `open`. Never waits for a pipe.

    Raises `OSError`: it cannot be opened, or is no regular file.
    """
    require_regular(path, follow=not flags & os.O_NOFOLLOW)
    # Non-blocking: between the check and the opening the name may have become a pipe.
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC, mode)
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return descriptor
    os.close(descriptor)
    raise OSError(errno.EINVAL, NOT_REGULAR)


def require_regular(path: str | Path, *, follow: bool = True) -> None:
    """Raise `OSError` where something else than a regular file is: opening some devices already has an effect."""
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(os.stat(path, follow_symlinks=follow).st_mode):
            raise OSError(errno.EINVAL, NOT_REGULAR)


def read_regular_file(path: Path, *, cap_bytes: int, area: str = "file") -> bytes:
    """Return the bytes of a regular file.

    Raises `ProfileError` with `<area>.unreadable` (missing, forbidden, or not a regular file) or
    `<area>.too_large` (more than `cap_bytes`).
    """
    where = printable(str(path))
    try:
        with open(path, "rb", opener=open_regular) as file:
            content = file.read(cap_bytes + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise refusal_error(f"{area}.unreadable", where=where, value=reason) from error
    if len(content) > cap_bytes:
        value = f"> {cap_bytes} bytes"
        raise refusal_error(f"{area}.too_large", where=where, value=value, limit=f"<= {cap_bytes} bytes")
    return content


def refuse_nul(content: bytes, where: str) -> None:
    """Refuse with `file.nul_bytes` what is mostly NUL bytes: UTF-16 without a byte order mark, or no text at all.

    UTF-8 decodes it without complaint, and every line of it is then wrong. A single one is told with its line.
    """
    if _NUL_PART * content.count(b"\0") >= max(len(content), 1):
        raise refusal_error("file.nul_bytes", where=where)


def parse_toml(content: bytes, where: str) -> dict[str, Any]:
    """Return the table in `content` (UTF-8, with or without a byte order mark).

    Raises `ProfileError`: `file.not_toml`, with line (`key`), column (`value`) and the text of the line (`limit`);
    `file.key_twice`, a key or table that was stated before, found at that line; `file.nul_bytes`.
    """
    refuse_nul(content, where)
    text = content.decode("utf-8-sig", "backslashreplace")
    lines, code = text.split("\n"), "file.not_toml"
    try:
        content.decode("utf-8-sig")
        for number, line in enumerate(lines, start=1):
            dots = line.count(".") if not line.lstrip().startswith("#") else 0
            if len(line) > TOML_LINE_CAP_CHARACTERS or dots > TOML_LINE_CAP_DOTS:
                raise ValueError(f"at line {number}, column 1")
        import tomllib  # nothing that only says its help reads a file

        return tomllib.loads(text)
    except UnicodeDecodeError as error:
        before = content[: error.start]
        row, column = before.count(b"\n") + 1, error.start - before.rfind(b"\n")
    except RecursionError:
        row, column = max(range(len(lines)), key=lambda place: lines[place].count("[")) + 1, 1
    except ValueError as error:  # tomllib.TOMLDecodeError is one; an integer of 5000 digits is another
        row, column = _toml_place(str(error), lines)
        code = "file.key_twice" if _STATED_TWICE.match(str(error)) else code
    shown = printable(lines[min(row, len(lines)) - 1].strip(), TOML_LINE_SHOWN)
    raise refusal_error(code, where=where, key=str(row), value=str(column), limit=f'"{shown}"')


def _toml_place(reason: str, lines: Sequence[str]) -> tuple[int, int]:
    """Return line and column, from 1, of an error of `tomllib`, which names them in English, or the end."""
    found = _TOML_PLACE.search(reason)
    if found is not None:
        return int(found[1]), int(found[2])
    written = [number for number, line in enumerate(lines, start=1) if line.strip()] or [1]
    return written[-1], len(lines[written[-1] - 1].rstrip()) + 1


def read_toml(path: Path) -> tuple[bytes, dict[str, Any]]:
    """Return the bytes of a TOML file and the table in them, or raise `ProfileError` (`file.*`)."""
    content = read_regular_file(path, cap_bytes=TOML_CAP_BYTES)
    return content, parse_toml(content, printable(str(path)))


def make_private_folder(folder: Path) -> None:
    """Make a folder, and those above it, whatever the umask; what is there stays as it is.

    They are their owner's alone, or their group's in a shared folder (`profiles.files`). Raises `OSError`.
    """
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    for each in reversed(missing):
        rights = rights_in(each.parent)
        with suppress(FileExistsError):  # another process was quicker; if it is no folder, that is found out below
            os.mkdir(each, rights.folder)
            os.chmod(each, rights.folder)
    folder.mkdir(exist_ok=True)


def make_private_file(path: Path) -> None:
    """Make an empty file with the rights of its folder, whatever the umask; one that is there stays as it is.

    Raises `OSError`.
    """
    mode = rights_in(path.parent).file
    with suppress(FileExistsError):
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        os.fchmod(descriptor, mode)
        os.close(descriptor)


def write_atomically(path: Path, content: bytes, *, overwrite: bool, private: bool = False) -> None:
    """Write `content` to `path`, as `written_atomically`."""
    with written_atomically(path, overwrite=overwrite, private=private) as file:
        file.write(content)


@contextmanager
def written_atomically(path: Path, *, overwrite: bool, private: bool = False) -> Iterator[BinaryIO]:
    """Yield a synchronised temporary file beside `path`, which becomes `path` when all of it was written.

    A `private` file has the rights of its folder (`profiles.files`), whatever the umask; any other new one
    has those of the umask, and in a shared folder those of its group. A symbolic link is followed, so the link
    stays. Temporary files of the same name left by killed writers are removed.
    Raises `ProfileError` with `file.exists` (and `overwrite` is false) or `file.not_writable`.
    """
    where = printable(str(path))
    temporary: Path | None = None
    try:
        target = path.resolve()
        from secrets import token_hex  # with all of its cryptography it is slow to import

        beside = target.with_name(f".{target.name}.{token_hex(4)}.tmp")
        existing = _mode_of_existing(target)
        remove_left(target.parent, target.name)
        rights = rights_in(target.parent)
        mode = rights.file if private else existing
        descriptor = made_locked(beside, mode if private and mode is not None else 0o666)
        temporary = beside
        with os.fdopen(descriptor, "wb") as file:
            if mode is not None:
                os.fchmod(file.fileno(), mode)
            elif rights.shared:
                os.fchmod(file.fileno(), stat.S_IMODE(os.fstat(file.fileno()).st_mode) | rights.file)
            yield file
            file.flush()
            os.fsync(file.fileno())
            # Not closed earlier: its lock shows that a writer is active.
            _move(temporary, target, overwrite=overwrite)
        synchronise_folder(target.parent)
    except FileExistsError as error:
        raise refusal_error("file.exists", where=where) from error
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: a loop of symbolic links
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise refusal_error("file.not_writable", where=where, value=reason) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def is_temporary(path: str) -> bool:
    """Whether a file is, by its name, the temporary file of a writer."""
    return _TEMPORARY.fullmatch(os.path.basename(path)) is not None


def remove_left(folder: Path, name: str = "") -> None:
    """Remove the temporary files that killed writers have left in a folder: those of one name, or all.

    All is only for folders in which nobody else has files.
    """
    try:
        found = list(os.scandir(folder))
    except OSError:  # it is created with the first file
        return
    for entry in found:
        left = _TEMPORARY.fullmatch(entry.name)
        if left is not None and name in ("", left[1]):
            remove_if_left(Path(entry.path))


def remove_all_left(folder: Path) -> None:
    """Remove the temporary files that killed writers have left in one of our folders and all below it."""
    for inner, _, _ in walk(folder):
        remove_left(Path(inner))


def walk(top: Path) -> Iterator[tuple[str, list[str], list[str]]]:
    """Yield the folders of one of ours, as `os.walk`, but none deeper than `MOST_DEPTH`."""
    for folder, folders, files in os.walk(top):
        if folder.count(os.sep) >= str(top).count(os.sep) + MOST_DEPTH:
            folders.clear()
        yield folder, folders, files


def made_locked(path: Path, mode: int) -> int:
    """Create a new file, and return its descriptor, for writing, with the lock held.

    Raises `OSError`: it cannot be created, or exists.
    """
    while True:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        if _is_at(descriptor, path):
            return descriptor
        os.close(descriptor)  # in between, another process has taken it for left and removed it


def taken_if_left(path: Path) -> int | None:
    """Return a locked descriptor of a file left by a dead process; None of any other file.

    Only a regular file of this user is ever taken, or in a shared folder one of its group.
    """
    try:
        # Neither follows a link nor waits for a pipe.
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        status = os.fstat(descriptor)
        if stat.S_ISREG(status.st_mode) and may_be_ours(status, path.parent):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(descriptor, path):
                return descriptor
    except OSError:  # a running process holds the lock
        pass
    os.close(descriptor)
    return None


def remove_if_left(path: Path) -> None:
    """Remove a file left by a dead process, if there is one."""
    descriptor = taken_if_left(path)
    if descriptor is not None:
        with suppress(OSError):
            path.unlink()
        os.close(descriptor)


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path, follow_symlinks=False))
    except OSError:
        return False


def _mode_of_existing(target: Path) -> int | None:
    try:
        status = os.stat(target)
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, NOT_REGULAR)
    return stat.S_IMODE(status.st_mode)


def _move(temporary: Path, target: Path, *, overwrite: bool) -> None:
    if not overwrite:
        try:
            os.link(temporary, target)  # fails if the name is taken, in the same instant
            return
        except FileExistsError:
            raise
        except OSError:  # a file system without hard links
            if target.exists():
                raise FileExistsError(errno.EEXIST, "exists", str(target)) from None
    os.replace(temporary, target)


def synchronise_folder(folder: Path) -> None:
    """Have the names in a folder written to the disk. Raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
