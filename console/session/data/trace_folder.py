"""Trace files of measured parts: the folder into which a gauge's files are put, and where traces are exported."""

from __future__ import annotations

import os
import stat
from datetime import UTC, datetime
from pathlib import Path

from console.session.data.kept_files import file_error, folder_name, make_folder
from profiles.traces import Trace, write_trace

FOLDER, EXPORTED = "traces", "exported-traces"
MOST_OFFERED = 500


def trace_folder(data: Path) -> Path:
    """Return the folder into which trace files are put, created where it is missing; as `make_folder`."""
    folder = data / FOLDER
    make_folder(folder)
    return folder


def list_trace_files(folder: Path) -> tuple[Path, ...]:
    """Return the files in a folder, newest first by their date of change; hidden ones and folders are left out.

    Raises ProfileError: `file.unreadable`, the folder cannot be read.
    """
    found: list[tuple[int, str, Path]] = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                status = _status(entry)
                if status is not None and not entry.name.startswith("."):
                    found.append((status.st_mtime_ns, entry.name, Path(entry.path)))
    except OSError as error:
        raise file_error("file.unreadable", folder, error) from error
    return tuple(path for *_, path in sorted(found, reverse=True)[:MOST_OFFERED])


def export_trace(data: Path, trace: Trace, *, job: str) -> Path:
    """Write a trace as CSV with its header lines, under the job's name and the time; return the file.

    Raises ProfileError: as `write_trace`; an existing file is never overwritten.
    """
    folder = data / EXPORTED
    make_folder(folder)
    now = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
    path = folder / f"{folder_name(job)}-{now}Z.csv"
    write_trace(path, trace, private=True)
    return path


def _status(entry: os.DirEntry[str]) -> os.stat_result | None:
    """Return the status of a regular file, or of one that a link leads to; None for anything else."""
    try:
        status = entry.stat()
    except OSError:  # gone meanwhile, or a link to nowhere
        return None
    return status if stat.S_ISREG(status.st_mode) else None
