"""The ring on disk: segments of half a minute, each readable alone, the oldest removed.

A running console holds a lock in the folder of its ring, which the kernel releases however the process ends. So a
ring without its lock was left by a killed console.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from console.session.data.kept_files import folder_name
from profiles.files import made_locked, make_private_folder, open_regular, rights_in, taken_if_left

FOLDER, RUNNING = "flight", "running"
LOCK, SEGMENT = "lock", ".segment"

SEGMENT_S = 30.0
SEGMENTS = 11  # one that is being written, and ten that hold the last five minutes
MOST_BYTES = 2_000_000  # of a segment; then another one begins early, and less than five minutes are kept


class SegmentRing:
    """The ring of this process. Every method may raise OSError; then the ring begins a new segment."""

    def __init__(self, data: Path, machine: str) -> None:
        running = data / FOLDER / RUNNING
        make_private_folder(running)
        self.folder = _own_folder(running, f"{folder_name(machine)}@{os.getpid()}")
        self._rights = rights_in(running).file
        self._lock: int | None = made_locked(self.folder / LOCK, self._rights)
        os.fchmod(self._lock, self._rights)  # whatever the umask
        self._file: int | None = None
        self._number = self._bytes = 0
        self._began_s = float("-inf")

    def is_due(self, now_s: float) -> bool:
        """Whether a new segment has to begin: with a header and a full state."""
        return self._file is None or now_s - self._began_s >= SEGMENT_S or self._bytes > MOST_BYTES

    def begin(self, now_s: float, header: Mapping[str, Any]) -> None:
        """Begin a segment, and remove the oldest."""
        self._end_segment()
        self._number += 1
        path = self.folder / f"{self._number:08d}{SEGMENT}"
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, self._rights)
        os.fchmod(self._file, self._rights)
        self._began_s, self._bytes = now_s, 0
        try:
            self.write([header])
        except OSError:
            path.unlink(missing_ok=True)
            raise
        for old in self.segments()[:-SEGMENTS]:  # not earlier: on a full disk they are what there is
            old.unlink(missing_ok=True)

    def write(self, lines: list[Mapping[str, Any]], *, through: bool = False) -> None:
        """Append lines in one piece, `through` to the disk."""
        data = b"".join(line_of(each) for each in lines)
        if self._file is None or not data:
            return
        try:
            if os.write(self._file, data) < len(data):
                raise OSError("no room for a whole line")
            if through:
                os.fdatasync(self._file)
        except OSError:
            self._end_segment()
            raise
        self._bytes += len(data)

    def segments(self) -> list[Path]:
        """Return the segments, oldest first."""
        return sorted(self.folder.glob(f"*{SEGMENT}"))

    def close(self, *, remove: bool) -> None:
        """Write nothing more; remove the ring, or leave it to the next start."""
        self._end_segment()
        if remove:
            shutil.rmtree(self.folder, ignore_errors=True)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _end_segment(self) -> None:
        if self._file is not None:
            with suppress(OSError):
                os.close(self._file)
            self._file = None


def line_of(value: Mapping[str, Any]) -> bytes:
    """Return one line of a recording."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def whole_lines(segments: list[Path]) -> Iterator[bytes]:
    """Yield the lines of segments; the last one of each may have been cut by a full disk or a killed process.

    One file is read at a time, and no more of it than it may have.
    """
    for path in segments:
        with suppress(OSError), open(path, "rb", opener=open_regular) as file:
            content = file.read(2 * MOST_BYTES)
            yield from (line for line in content.splitlines(keepends=True) if line.endswith(b"\n"))


def left_rings(data: Path, machine: str) -> Iterator[Path]:
    """Yield the rings that killed consoles of this user have left on a machine; locked until the next one."""
    name = re.compile(re.escape(folder_name(machine)) + r"@\d+(\.\d+)?")
    with suppress(OSError):
        for folder in sorted((data / FOLDER / RUNNING).iterdir()):
            lock = taken_if_left(folder / LOCK) if name.fullmatch(folder.name) else None
            if lock is not None:
                try:
                    yield folder
                finally:
                    os.close(lock)


def _own_folder(running: Path, name: str) -> Path:
    """Make a folder; a process of the same number may run elsewhere, on the same data folder."""
    rights = rights_in(running).folder
    for number in range(100):
        folder = running / (f"{name}.{number}" if number else name)
        with suppress(FileExistsError):
            folder.mkdir(mode=rights)
            folder.chmod(rights)
            return folder
    raise FileExistsError(17, "too many rings", str(running / name))
