"""Files of the operator's own jobs: deleted and brought back, imported, exported. None is ever overwritten."""

from __future__ import annotations

import itertools
import os
import re
from datetime import UTC, datetime
from pathlib import Path

from console.session.data.kept_files import file_error, jobs_folder, make_folder, path_exists, paths_in
from profiles.files import TOML_CAP_BYTES, printable, read_regular_file, write_atomically
from profiles.problem import Problem, ProfileError
from profiles.store import LibraryEntry, load_job

DELETED, IMPORT, EXPORTED = "deleted", "import", "exported-jobs"
_STAMPED = re.compile(r"(.+)\.[0-9]{8}T[0-9]{12}Z(?:-[0-9]+)?\.toml", re.DOTALL)


def delete_job(data: Path, path: Path) -> Path:
    """Move a job into the folder of deleted ones, under its name and the time; return the file there.

    Raises ProfileError: `file.not_writable`.
    """
    folder = jobs_folder(data) / DELETED
    make_folder(folder)
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f") + "Z"
    names = itertools.chain([stamp], (f"{stamp}-{number}" for number in itertools.count(2)))
    target = next(each for name in names if not path_exists(each := folder / f"{path.stem}.{name}.toml"))
    _move(path, target)
    return target


def last_deleted(data: Path) -> tuple[Path, str] | None:
    """Return the job that was deleted last, with the name that it had; None where there is none.

    Raises ProfileError: `file.unreadable`.
    """
    found = [(each, _STAMPED.fullmatch(each.name)) for each in paths_in(jobs_folder(data) / DELETED)]
    named = [(each, match[1]) for each, match in found if match is not None]
    return max(named, key=lambda pair: pair[0].name[len(pair[1]) :], default=None)


def restore_job(data: Path, deleted: Path, name: str) -> Path:
    """Move a deleted job back under its name; ProfileError `file.exists`, `file.not_writable`."""
    target = jobs_folder(data) / f"{name}.toml"
    _move(deleted, target)
    return target


def import_folder(data: Path) -> Path:
    """Return the folder into which job files are put to be imported, created where it is missing."""
    folder = data / IMPORT
    make_folder(folder)
    return folder


def import_job(data: Path, source: Path) -> Path:
    """Copy a sound job file among the own jobs, byte for byte under its own name; return the new file.

    Raises ProfileError: every problem of the job, `file.exists`, `file.not_writable`.
    """
    content = load_job(LibraryEntry(name=source.stem, path=source, bundled=False)).text.encode("utf-8")
    folder = jobs_folder(data)
    make_folder(folder)
    path = folder / source.name
    write_atomically(path, content, overwrite=False, private=True)
    return path


def export_job(data: Path, path: Path) -> Path:
    """Copy a job file, byte for byte, to the folder of exported jobs under a free name; return the copy.

    Raises ProfileError: as `read_regular_file`, `file.not_writable`.
    """
    content = read_regular_file(path, cap_bytes=TOML_CAP_BYTES)
    folder = data / EXPORTED
    make_folder(folder)
    names = itertools.chain([path.stem], (f"{path.stem}-{number}" for number in itertools.count(2)))
    target = next(each for name in names if not path_exists(each := folder / f"{name}.toml"))
    write_atomically(target, content, overwrite=False, private=True)
    return target


def _move(path: Path, target: Path) -> None:
    """Move a file to a name that is free, and to no other."""
    try:
        try:
            os.link(path, target, follow_symlinks=False)  # fails in the same instant if the name is taken
        except FileExistsError:
            raise
        except OSError:  # a file system without hard links
            if os.path.lexists(target):
                raise FileExistsError(str(target)) from None
            os.rename(path, target)
            return
        os.unlink(path)
    except FileExistsError as error:
        raise ProfileError(Problem(code="file.exists", where=printable(str(target)))) from error
    except OSError as error:
        raise file_error("file.not_writable", path, error) from error
