"""Trace files of measured parts: the folder into which a gauge's files are put, and where traces are exported."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from console.session.data.kept_files import folder_name, make_folder
from profiles.traces import Trace, write_trace

FOLDER, EXPORTED = "traces", "exported-traces"


def trace_folder(data: Path) -> Path:
    """Return the folder into which trace files are put, created where it is missing; as `make_folder`."""
    folder = data / FOLDER
    make_folder(folder)
    return folder


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
