"""The journal of a study: a line for each cell that was made, so that a killed study resumes where it was.

A line is whole or not there: what a kill has cut short is cut off at the next start, and its cell is made again.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from console.session.data.kept_files import file_error
from console.session.errors import SessionError
from console.site.study.cells import COLUMNS, Row
from profiles.files import open_regular, printable
from profiles.problem import Problem
from profiles.strict_values import from_json

NAME = "journal.jsonl"


class Journal:
    """An open journal. `made` has the rows of each cell that is in it."""

    def __init__(self, descriptor: int, made: dict[int, tuple[Row, ...]]) -> None:
        self._descriptor, self.made = descriptor, made

    def add(self, number: int, rows: Sequence[Row]) -> None:
        """Add a cell; it is on the disk when this returns. OSError."""
        _append(self._descriptor, {"cell": number, "rows": rows})
        self.made[number] = tuple(rows)


@contextmanager
def journal(folder: Path, identity: str) -> Iterator[Journal]:
    """Open the journal of a study in its folder, both made where missing; one process at a time.

    Raises:
        SessionError: `study.running`, another process has it; `study.other`, it is of another study, or of other
            jobs, machines, plants, or software; `study.journal`, it is none.
        ProfileError: `file.not_writable`.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = open_regular(path, os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise file_error("file.not_writable", path, error) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SessionError(Problem(code="study.running", where=printable(str(folder)))) from None
        except OSError:  # a file system without locks
            pass
        yield Journal(descriptor, _read(descriptor, path, identity))
    except OSError as error:
        raise file_error("file.not_writable", path, error) from error
    finally:
        os.close(descriptor)


def _read(descriptor: int, path: Path, identity: str) -> dict[int, tuple[Row, ...]]:
    with open(descriptor, "rb", closefd=False) as file:
        content = file.read()
    whole = content[: content.rfind(b"\n") + 1]
    os.ftruncate(descriptor, len(whole))
    os.lseek(descriptor, 0, os.SEEK_END)
    head, *lines = whole.splitlines() or [b""]
    where = printable(str(path))
    if not whole:
        _append(descriptor, {"study": identity})
        return {}
    try:
        if from_json(head)["study"] != identity:
            raise SessionError(Problem(code="study.other", where=where))
        return dict(map(_cell, lines))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SessionError(Problem(code="study.journal", where=where)) from error


def _cell(line: bytes) -> tuple[int, tuple[Row, ...]]:
    found = from_json(line)
    rows = tuple({column: row[column] for column in COLUMNS} for row in found["rows"])
    return int(found["cell"]), rows


def _append(descriptor: int, table: dict[str, object]) -> None:
    content = (json.dumps(table, ensure_ascii=False) + "\n").encode("utf-8", "backslashreplace")
    while content:
        content = content[os.write(descriptor, content) :]
    os.fsync(descriptor)
