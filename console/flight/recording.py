"""Reading of a frozen recording: every state and every note of it, or a refusal that says what is wrong where.

The file may be somebody else's, cut short, or changed: nothing in it is run, and nothing of it is taken on trust.
"""

from __future__ import annotations

import json
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from console.flight.frozen import SCHEMA, Cause
from console.flight.notes import Note
from console.flight.plain_values import names_of
from console.flight.recorded_forms import Moment
from console.flight.typed_values import Typed, machine_of, patched
from profiles.files import printable, read_regular_file
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.strict_values import from_json, number, whole

MOST_PACKED, MOST_BYTES = 40_000_000, 120_000_000  # far above any recording; a bomb ends here
MOST_LINES = 400_000
MOST_HEADER = 200_000
LONGEST_S = 86_400.0  # of all times of a recording from its beginning
LAST_UTC_S = 1e11  # some year that no computer reaches
_CHUNK = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """Origin of a recording: machine, program, what it was frozen for. `at_s` is machine time at `utc_s`."""

    flight: int
    software: str
    machine: MachineProfile
    machine_path: Path
    machine_sha256: str
    simulated: bool
    console: int
    at_s: float
    utc_s: float
    causes: tuple[Cause, ...]
    began_s: float
    ended_s: float
    lines: int
    sha256: str

    @property
    def length_s(self) -> float:
        """The time from the first to the last line."""
        return self.ended_s - self.began_s

    def utc_of(self, at_s: float) -> float:
        """Return the time of day of a machine time, s since 1970."""
        return self.utc_s + at_s - self.at_s


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A whole recording: `moments` at `times_s`, which never go back; the notes in the order of time."""

    path: Path
    header: Header
    times_s: tuple[float, ...]
    moments: tuple[Moment, ...]
    notes: tuple[Note, ...]

    def place_at(self, at_s: float) -> int:
        """Return the place of the newest moment at a time; the first one before the beginning."""
        return max(bisect_right(self.times_s, at_s) - 1, 0)

    @cached_property
    def length_s(self) -> float:
        """The time from the first to the last moment."""
        return self.times_s[-1] - self.times_s[0]


def read_header(path: Path) -> Header:
    """Return what a recording is of. Raises ProfileError as `read_recording`."""
    head = b""
    for piece in _pieces(path):
        head += piece
        if b"\n" in head or len(head) > MOST_HEADER:
            break
    return _header(path, head.partition(b"\n")[0])


def read_recording(path: Path) -> Recording:
    """Read a recording.

    Raises:
        ProfileError: `file.unreadable`, `file.too_large`, `schema.unsupported`; `flight.not_one`, it is no
            recording; `flight.damaged`, with the line.
    """
    import hashlib

    content = b"".join(_pieces(path))
    head, _, rest = content.partition(b"\n")
    header = _header(path, head)
    lines = rest.splitlines(keepends=True)
    if hashlib.sha256(rest).hexdigest() != header.sha256 or len(lines) != header.lines:
        raise _damaged(path, 0, f"{len(lines)} / {header.lines}")
    return _played(path, header, lines)


def _played(path: Path, header: Header, lines: list[bytes]) -> Recording:
    typed, tree = Typed(), None
    times_s: list[float] = []
    moments: list[Moment] = []
    notes: list[Note] = []
    for place, line in enumerate(lines, start=2):
        try:
            found = from_json(line)
            if not abs(number(found["t"]) - header.began_s) <= LONGEST_S:
                raise ValueError("a time far from the others")
            if "kind" in found:
                note = {"at_s": found["t"], "kind": found["kind"], "text": found["text"]}
                notes.append(typed.read(Note, note))
                continue
            if found.keys() != {"t", "full"} and (tree is None or found.keys() != {"t", "set"}):
                raise ValueError("neither a state nor a note")
            tree = found["full"] if "full" in found else patched(tree or {}, found["set"])
            moment, at_s = typed.read(Moment, tree), number(found["t"])
            if times_s and at_s < times_s[-1]:
                raise ValueError("time goes back")
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
            raise _damaged(path, place, f"{type(error).__name__}: {error}") from error
        times_s.append(at_s)
        moments.append(moment)
    if not moments:
        raise _damaged(path, 2, "")
    ordered = tuple(sorted(notes, key=lambda note: note.at_s))
    return Recording(path=path, header=header, times_s=tuple(times_s), moments=tuple(moments), notes=ordered)


def _header(path: Path, line: bytes) -> Header:
    where = printable(str(path))
    try:
        found: Any = json.loads(line) if len(line) <= MOST_HEADER else None
        schema = found["flight"]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ProfileError(Problem(code="flight.not_one", where=where)) from error
    if type(schema) is not int or schema != SCHEMA:
        shown = printable(str(schema), 60)
        problem = Problem(code="schema.unsupported", where=where, key="flight", value=shown, limit=str(SCHEMA))
        raise ProfileError(problem)
    try:
        if found.keys() != {*names_of(Header)}:
            raise ValueError("other keys")
        header: Header = Typed().read(Header, found)
        machine_of(found["machine"])
        whole(found["lines"])
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise _damaged(path, 1, f"{type(error).__name__}: {error}") from error
    times_s = (header.began_s, header.ended_s, header.at_s, *(cause.at_s for cause in header.causes))
    near = all(abs(at_s - header.began_s) <= LONGEST_S for at_s in times_s)
    if not (near and header.began_s <= header.ended_s and 0.0 <= header.utc_s <= LAST_UTC_S):
        raise _damaged(path, 1, "began_s, ended_s, at_s, utc_s, causes")
    if not 0 < header.lines <= MOST_LINES:
        raise _damaged(path, 1, "lines")
    return header


def _pieces(path: Path) -> Iterator[bytes]:
    """Yield what is in the compressed file, within bounds."""
    packed = read_regular_file(path, cap_bytes=MOST_PACKED)
    unpacker = zlib.decompressobj(wbits=31)
    total, left = 0, packed
    try:
        while left and not unpacker.eof:
            piece = unpacker.decompress(left, _CHUNK)
            left, total = unpacker.unconsumed_tail, total + len(piece)
            if total > MOST_BYTES:
                limit = f"<= {MOST_BYTES} bytes"
                raise ProfileError(Problem(code="file.too_large", where=printable(str(path)), limit=limit))
            yield piece
    except zlib.error as error:
        code = "flight.damaged" if total else "flight.not_one"
        problem = Problem(code=code, where=printable(str(path)), key="1", value=printable(str(error)))
        raise ProfileError(problem) from error
    if not unpacker.eof or unpacker.unused_data:
        code = "flight.damaged" if total else "flight.not_one"
        raise ProfileError(Problem(code=code, where=printable(str(path)), key="1", value="gzip"))


def _damaged(path: Path, line: int, why: str) -> ProfileError:
    value = printable(" ".join(why.split()), 160)
    return ProfileError(Problem(code="flight.damaged", where=printable(str(path)), key=str(line), value=value))
