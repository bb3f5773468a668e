"""Frozen recordings: one compressed file each, named by time, machine and reason; the newest are kept."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from console.flight.ring import FOLDER, line_of
from console.session.data.kept_files import folder_name, make_folder
from profiles.files import write_atomically
from profiles.problem import ProfileError, refusal_error

SUFFIX = ".flight"
SCHEMA = 1
MOST_FILES = 200
MOST_BYTES = 200_000_000

_NAME = re.compile(r"\d{8}T\d{6}Z-.+")
_LEVEL = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class FreezeCause:
    """Why a recording was frozen: the code of an alarm, a stop with its reason, a signal; at machine time."""

    at_s: float
    reason: str


def freeze(
    data: Path, lines: Iterator[bytes], causes: Sequence[FreezeCause], to: Path | None = None
) -> Path | None:
    """Write a frozen recording and remove the oldest ones; return its path, None where nothing was recorded.

    `lines` are those of a ring. `to` is replaced where it is given.

    Raises:
        ProfileError: `file.not_writable`.
    """
    import gzip

    header, body, first_s, last_s = _parse_segment_lines(lines)
    if header is None or first_s is None or last_s is None:
        return None
    causes = causes or (FreezeCause(at_s=last_s, reason="killed"),)
    content = _content(header, body, causes, (first_s, last_s))
    packed = gzip.compress(content, _LEVEL, mtime=0)
    folder = data / FOLDER
    make_folder(folder)
    if to is not None:
        write_atomically(to, packed, overwrite=True, private=True)
        return to
    path = _write_recording(folder, _name(header, causes[0]), packed)
    _remove_oldest(folder, path)
    return path


def frozen_in(data: Path) -> list[Path]:
    """Return the frozen recordings in a data folder, newest first."""
    found = (data / FOLDER).glob(f"*{SUFFIX}")
    return sorted((path for path in found if _NAME.fullmatch(path.stem)), reverse=True)


def _parse_segment_lines(
    lines: Iterator[bytes],
) -> tuple[dict[str, Any] | None, list[bytes], float | None, float | None]:
    """Return the last header, the other lines, and the first and last time in them."""
    header: dict[str, Any] | None = None
    body: list[bytes] = []
    first_s: float | None = None
    last_s: float | None = None
    for line in lines:
        with suppress(ValueError, TypeError, KeyError, RecursionError):
            found = json.loads(line)
            if "flight" in found:
                header = found
                continue
            if not body and "full" not in found:  # what comes before the first full state shows nothing
                continue
            last_s = max(float(found["t"]), last_s or float("-inf"))
            first_s = last_s if first_s is None else first_s
            body.append(line)
    return header, body, first_s, last_s


def _content(
    header: Mapping[str, Any], body: Sequence[bytes], causes: Sequence[FreezeCause], span_s: tuple[float, float]
) -> bytes:
    import hashlib

    rest = b"".join(body)
    first = {
        **header,
        "causes": [{"at_s": cause.at_s, "reason": cause.reason} for cause in causes],
        "began_s": span_s[0],
        "ended_s": span_s[1],
        "lines": len(body),
        "sha256": hashlib.sha256(rest).hexdigest(),
    }
    return line_of(first) + rest


def _name(header: Mapping[str, Any], cause: FreezeCause) -> str:
    at = datetime.fromtimestamp(float(header["utc_s"]) + cause.at_s - float(header["at_s"]), UTC)
    reason = re.sub(r"[^A-Za-z0-9._]+", "-", cause.reason).strip("-")[:48] or "unknown"
    return f"{at:%Y%m%dT%H%M%SZ}-{folder_name(str(header['machine']['name']))[:80]}-{reason}"


def _write_recording(folder: Path, name: str, content: bytes) -> Path:
    path = folder / f"{name}{SUFFIX}"
    for number in range(2, 100):
        try:
            write_atomically(path, content, overwrite=False, private=True)
            return path
        except ProfileError as error:
            if error.problems[0].code != "file.exists":
                raise
        path = folder / f"{name}-{number}{SUFFIX}"
    raise refusal_error("file.exists", where=str(path))


def _remove_oldest(folder: Path, newest: Path) -> None:
    """Keep what the bounds allow, and the newest in any case."""
    total = 0
    for number, path in enumerate(frozen_in(folder.parent)):
        with suppress(OSError):
            total += path.lstat().st_size
            if path != newest and (number >= MOST_FILES or total > MOST_BYTES):
                path.unlink()
