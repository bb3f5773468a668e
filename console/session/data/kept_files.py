"""Files in the data folder, and where that is: one file each, plain values, never overwritten; and their dates."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import quote

from console.session.errors import SessionError
from console.session.operator import account_name, home_of
from drivers.clock import boot_s
from profiles.files import make_private_folder, printable, read_regular_file, write_atomically
from profiles.problem import Problem, ProfileError
from profiles.strict_values import from_json

CAP_BYTES = 1_000_000
MOST_OFFERED = 500  # files of a folder, the newest ones

APPLICATION = "trilobe"
READ_FROM = ("jobs", "machines", "gauges", "learned", "calibrations", "stops", "trials")
"""Folders in the data folder from which files are taken by themselves."""


def folder_name(name: str) -> str:
    """Return the folder name of a machine or a job, safe whatever characters its own name has."""
    return quote(name, safe=" ").replace(".", "%2E")


def make_folder(folder: Path) -> None:
    """Create a folder for its owner alone where it is missing; ProfileError `file.not_writable` if it cannot."""
    with file_errors("file.not_writable", folder):
        make_private_folder(folder)


@contextmanager
def file_errors(code: str, path: Path) -> Iterator[None]:
    """Raise what the operating system refuses in the block as `file_error`."""
    try:
        yield
    except OSError as error:
        raise file_error(code, path, error) from error


def file_error(code: str, path: Path, error: OSError) -> ProfileError:
    """Return the refusal of a file or a folder, with the reason of the operating system."""
    return ProfileError(Problem(code=code, where=printable(str(path)), value=error.strerror or str(error)))


def path_exists(path: Path) -> bool:
    """Return whether there is anything at a path. Raises ProfileError: `file.unreadable`, its folder is closed."""
    with file_errors("file.unreadable", path):
        return path.exists()


def require_open(folder: Path) -> None:
    """Raise ProfileError `file.unreadable` where a folder cannot be listed or entered; a missing one is fine."""
    with file_errors("file.unreadable", folder), suppress(FileNotFoundError, NotADirectoryError):
        first = next(folder.iterdir(), None)
        if first is not None:
            first.lstat()


def paths_in(folder: Path) -> list[Path]:
    """Return what is in a folder, nothing where there is no folder.

    Raises ProfileError: `file.unreadable`, it cannot be read: closed is not empty.
    """
    with file_errors("file.unreadable", folder):
        try:
            return list(folder.iterdir())
        except (FileNotFoundError, NotADirectoryError):  # it is made with the first file
            return []


def names_in(folder: Path, suffix: str) -> list[Path]:
    """Return the files of a folder with a suffix; raises as `paths_in`."""
    with file_errors("file.unreadable", folder):
        return [path for path in paths_in(folder) if path.suffix == suffix and path.is_file()]


def newest_files(folder: Path, suffix: str = "") -> tuple[Path, ...]:
    """Return the files in a folder, newest first by their date of change; hidden ones and folders are left out.

    Raises ProfileError: `file.unreadable`, the folder cannot be read.
    """
    found: list[tuple[int, str, Path]] = []
    with file_errors("file.unreadable", folder), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(".") or not entry.name.endswith(suffix):
                continue
            with suppress(OSError):  # gone meanwhile, or a link to nowhere
                if entry.is_file():
                    found.append((entry.stat().st_mtime_ns, entry.name, Path(entry.path)))
    return tuple(path for *_, path in sorted(found, reverse=True)[:MOST_OFFERED])


def keep(path: Path, table: Mapping[str, Any]) -> None:
    """Write a new file, creating its folder; ProfileError `file.exists`, `file.not_writable`."""
    make_folder(path.parent)
    import json  # not for the first page

    content = json.dumps(table, ensure_ascii=False, allow_nan=False, indent=2)
    write_atomically(path, f"{content}\n".encode(), overwrite=False, private=True)


def keep_numbered(folder: Path, stem: str, newest: int, table: Mapping[str, Any]) -> Path:
    """Write a new file under the next free number behind the newest; ProfileError `file.not_writable`."""
    for number in count(newest + 1):
        path = folder / f"{stem}-{number:06d}.json"
        try:
            keep(path, table)
            break
        except ProfileError as error:  # others may keep one at the same instant
            if error.problems[0].code != "file.exists":
                raise
    return path


def delete_file(path: Path) -> None:
    """Delete a file where it is there; ProfileError `file.not_writable`."""
    with file_errors("file.not_writable", path):
        path.unlink(missing_ok=True)


def read_kept_values(file: Path, code: str) -> Any:
    """Return the values in a file; ProfileError as `read_regular_file`, or `code` if it is not ours."""
    content = read_regular_file(file, cap_bytes=CAP_BYTES)
    try:
        return from_json(content)
    except ValueError as error:
        where, value = printable(str(file)), printable(str(error))
        raise ProfileError(Problem(code=code, where=where, value=value)) from error


def data_folder(given: str | None = None) -> Path:
    """Return the data folder (XDG base directories); it need not exist. Raises `SessionError`: `data.no_home`."""
    if given:
        return Path(given)
    base = os.environ.get("XDG_DATA_HOME", "")
    # The XDG Base Directory Specification says to ignore a relative path in the variable.
    if os.path.isabs(base):
        return Path(base) / APPLICATION
    home = home_of(os.environ)
    if home is None:
        raise SessionError(Problem(code="data.no_home", value=str(os.getuid())))
    return Path(home) / ".local" / "share" / APPLICATION


def refuse_closed(data: Path) -> None:
    """Refuse a data folder that is there and closed to this account, or one in it: SessionError `data.closed`.

    What is read from would look empty, and a cut would silently do without what was learned. A file in place of a
    folder is `data.no_folder`.
    """
    for folder in (data, *(data / name for name in READ_FROM)):
        try:
            if not stat.S_ISDIR(os.stat(folder).st_mode):
                raise SessionError(Problem(code="data.no_folder", where=printable(str(folder))))
            closed = not os.access(folder, os.R_OK | os.X_OK)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:  # one above it is closed
            closed = True
        if closed:
            raise SessionError(Problem(code="data.closed", where=printable(str(folder)), value=account_name()))


def jobs_folder(data: Path) -> Path:
    """Return the folder of the operator's own jobs."""
    return data / "jobs"


def machines_folder(data: Path) -> Path:
    """Return the folder of the site's own machines."""
    return data / "machines"


def gauges_folder(data: Path) -> Path:
    """Return the folder of the site's own gauges."""
    return data / "gauges"


TOLERANCE = timedelta(minutes=10)  # allowed clock difference of two computers that share a data folder


def utc_now() -> str:
    """Return the date for newly stored data, UTC after ISO 8601."""
    return _format_date(datetime.now(UTC))


def _format_date(date: datetime) -> str:
    return date.isoformat(timespec="milliseconds").replace("+00:00", "Z")


class RunDates:
    """The dates of one run, whose differences are durations though the computer's clock is set meanwhile.

    Beside them, its machine time: that of a simulated lathe is not the time that passes on the computer.
    """

    def __init__(self, now_s: Callable[[], float] = boot_s) -> None:
        self._began, self._began_s = datetime.now(UTC), boot_s()
        self._since = 0.0, now_s(), now_s  # machine time so far, and the clock since then: replaced in one go

    def follow(self, now_s: Callable[[], float]) -> None:
        """Continue the machine time with another clock: each simulated part has a machine of its own."""
        self._since = self.machine_s(), now_s(), now_s

    def machine_s(self) -> float:
        """Return the machine time since the record was begun."""
        passed_s, since_s, now_s = self._since
        return passed_s + now_s() - since_s

    def now(self) -> str:
        """Return the date of its beginning, by the computer's clock then, and the time that has passed since."""
        return _format_date(self._began + timedelta(seconds=boot_s() - self._began_s))


def is_ahead(date: str, now: str | None = None) -> bool:
    """Return whether an ISO 8601 date is in the future: a clock was ahead then, or has been set back since.

    A date without a zone is UTC; a text that is no date is not in the future.
    """
    now = now or utc_now()
    try:
        return _parse_date(date) - _parse_date(now) > TOLERANCE
    except OverflowError:  # at either end of the calendar's range
        return date > now
    except ValueError:
        return False


def ahead_problems(code: str, dates: Iterable[str], *, key: str, where: str = "") -> tuple[Problem, ...]:
    """Return a problem of this code for the first of these dates that is in the future."""
    now = utc_now()
    ahead = [printable(date, 60) for date in dates if is_ahead(date, now)]
    return tuple(Problem(code=code, where=where, key=key, value=date, limit=now) for date in ahead[:1])


def _parse_date(date: str) -> datetime:
    found = datetime.fromisoformat(date)
    return found.replace(tzinfo=UTC) if found.tzinfo is None else found.astimezone(UTC)


def numbered_files(folder: Path, pattern: re.Pattern[str]) -> list[tuple[int, Path]]:
    """Return the files whose whole name matches, by the number in it, the highest first; raises as `paths_in`."""
    found = [(pattern.fullmatch(file.name), file) for file in paths_in(folder)]
    return sorted(((int(match[1]), file) for match, file in found if match is not None), reverse=True)
