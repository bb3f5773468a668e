"""Reading of a frozen recording: every state and every note of it, or a refusal that says what is wrong where.

The file may be somebody else's, cut short, or changed: nothing in it is run, and nothing of it is taken on trust.
Plain JSON values become frozen dataclasses again, each of the type of its field and within bounds, or are refused;
nothing in the file names a type.
"""

from __future__ import annotations

import json
import zlib
from base64 import b64decode
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_origin, get_type_hints

from console.flight.frozen_recordings import SCHEMA, FreezeCause
from console.flight.notes import Note
from console.flight.plain_values import ARRAY, DROPPED, LONGEST_TEXT, names_of
from console.flight.recorded_forms import RecordedMoment, names
from profiles.files import printable, read_regular_file
from profiles.job import Job, job_from_table
from profiles.machine import OF_CALIBRATION, MachineProfile, machine_from_table
from profiles.problem import Problem, ProblemError, ProfileError
from profiles.strict_values import StrictReader, brief, flag, from_json, number, text, whole_number

MOST_PACKED, MOST_BYTES = 40_000_000, 120_000_000  # far above any recording; a bomb ends here
MOST_LINES = 400_000
MOST_HEADER = 200_000
LONGEST_S = 86_400.0  # of all times of a recording from its beginning
LAST_UTC_S = 1e11  # some year that no computer reaches
_CHUNK = 1 << 20
LARGEST = 1e15  # no position, time or count of a lathe is larger
MOST_NUMBERS = 200_000  # in an array: a trace of a part has some thousand
MOST_ENTRIES = 10_000  # in a list or a table
_INFINITE = ("nan", "inf", "-inf")
_ARRAYS = ("ndarray", "NDArray")
"""What a field of samples is annotated with, by its name: from 2.5 on that of numpy is an alias that stays one."""


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
    causes: tuple[FreezeCause, ...]
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
    moments: tuple[RecordedMoment, ...]
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
        raise _damage_error(path, 0, f"{len(lines)} / {header.lines}")
    return _assemble_recording(path, header, lines)


class RecordingReader(StrictReader):
    """Reader of a recording. A part that was read is the same object wherever the same part of the JSON is."""

    most_entries = MOST_ENTRIES
    complete = True
    table = MappingProxyType

    def __init__(self) -> None:
        self.plain = _PLAIN
        self._known: dict[tuple[int, Any], tuple[object, Any]] = {}

    def read(self, hint: Any, value: Any) -> Any:
        """Return the value of a type. Raises ValueError, TypeError: of another type, out of bounds, unknown."""
        if not isinstance(value, dict | list):
            return self._read(hint, value)
        found = self._known.get((id(value), hint))
        if found is None:
            # The JSON is kept as well: its identity must not be used again.
            found = self._known[(id(value), hint)] = (value, self._read(hint, value))
        return found[1]

    def _read(self, hint: Any, value: Any) -> Any:
        if hint is Job and isinstance(value, dict):
            return _of_its_file(job_from_table, value)
        return _array(value) if getattr(get_origin(hint), "__name__", "") in _ARRAYS else super().read(hint, value)

    def hints(self, kind: type) -> Mapping[str, Any]:
        """Return the type of each field."""
        return _hints(kind)


def apply_changes(tree: dict[str, Any], changed: Mapping[str, Any]) -> dict[str, Any]:
    """Return JSON with these parts replaced, by dotted names; what is not replaced is shared.

    Raises ValueError: there is no such part.
    """
    fresh: dict[str, dict[str, Any]] = {"": dict(tree)}
    for path, value in changed.items():
        *above, last = path.split(".")
        node, here = fresh[""], ""
        for name in above:
            here = f"{here}.{name}"
            if here not in fresh:
                if not isinstance(node.get(name), dict):
                    raise ValueError(f"no {path}")
                fresh[here] = node[name] = dict(node[name])
            node = fresh[here]
        if last not in node:
            raise ValueError(f"no {path}")
        node[last] = _slide_samples(node[last], value) if isinstance(value, dict) and DROPPED in value else value
    return fresh[""]


def _slide_samples(before: Any, change: dict[str, Any]) -> dict[str, Any]:
    """Return the samples after some left and some came."""
    gone = whole_number(change[DROPPED])
    kept = _bytes(before)[8 * gone :]
    if gone < 0 or 8 * gone > len(_bytes(before)) or change.keys() != {DROPPED, ARRAY}:
        raise ValueError("samples that do not follow")
    return {ARRAY: kept + _bytes({ARRAY: change[ARRAY]})}


def _bytes(value: Any) -> bytes:
    if not isinstance(value, dict) or value.keys() != {ARRAY}:
        raise TypeError("no array")
    data = value[ARRAY]
    found = data if isinstance(data, bytes) else b64decode(text(data), validate=True)
    if len(found) % 8 or len(found) > 8 * MOST_NUMBERS:
        raise ValueError(f"{len(found)} bytes in an array")
    return found


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    return get_type_hints(kind, None, dict(names()))


def _number(value: Any) -> float:
    if isinstance(value, str) and value in _INFINITE:
        return float(value)
    found = number(value)
    if abs(found) > LARGEST:
        raise ValueError(f"{found:g} is too large")
    return found


def _read_whole_number(value: Any) -> int:
    return whole_number(value) if abs(_number(value)) <= LARGEST else 0


def _text(value: Any) -> str:
    found = text(value)
    if len(found) > LONGEST_TEXT or not found.isprintable():
        raise ValueError(f"a text that cannot be shown: {brief(found)}")
    return found


def _complex(value: Any) -> complex:
    real, imaginary = (_number(each) for each in value)
    return complex(real, imaginary)


def _array(value: Any) -> Any:
    import numpy as np

    found = np.frombuffer(_bytes(value), dtype="<f8").astype(float)
    with np.errstate(invalid="ignore"):
        if (np.abs(found) > LARGEST).any():
            raise ValueError("an array with a number that is too large")
    found.setflags(write=False)
    return found


def machine_of(value: Any) -> MachineProfile:
    """Return a machine with its calibrations, which its own file does not have. Raises ValueError, TypeError."""
    found: MachineProfile = RecordingReader().read(MachineProfile, value)
    _of_its_file(machine_from_table, {**value, "chuck": {**value["chuck"], **dict.fromkeys(OF_CALIBRATION)}})
    return found


def _of_its_file(read: Callable[[Mapping[str, Any]], Any], value: dict[str, Any]) -> Any:
    """Read a job or a machine as its own file is read, with its limits."""
    try:
        return read(drop_missing_values(value))
    except ProblemError as error:
        raise ValueError(error.problems[0].facts) from error


def drop_missing_values(value: Any) -> Any:
    """Return values without those that are None: a TOML table does not have them."""
    if isinstance(value, dict):
        return {key: drop_missing_values(each) for key, each in value.items() if each is not None}
    return [drop_missing_values(each) for each in value] if isinstance(value, list) else value


_PLAIN: Mapping[Any, Any] = {
    float: _number,
    int: _read_whole_number,
    bool: flag,
    str: _text,
    complex: _complex,
    Path: lambda value: Path(_text(value)),
}


def _assemble_recording(path: Path, header: Header, lines: list[bytes]) -> Recording:
    typed, tree = RecordingReader(), None
    times_s: list[float] = []
    moments: list[RecordedMoment] = []
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
            tree = found["full"] if "full" in found else apply_changes(tree or {}, found["set"])
            moment, at_s = typed.read(RecordedMoment, tree), number(found["t"])
            if times_s and at_s < times_s[-1]:
                raise ValueError("time goes back")
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
            raise _damage_error(path, place, f"{type(error).__name__}: {error}") from error
        times_s.append(at_s)
        moments.append(moment)
    if not moments:
        raise _damage_error(path, 2, "")
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
        header: Header = RecordingReader().read(Header, found)
        machine_of(found["machine"])
        whole_number(found["lines"])
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise _damage_error(path, 1, f"{type(error).__name__}: {error}") from error
    times_s = (header.began_s, header.ended_s, header.at_s, *(cause.at_s for cause in header.causes))
    near = all(abs(at_s - header.began_s) <= LONGEST_S for at_s in times_s)
    if not (near and header.began_s <= header.ended_s and 0.0 <= header.utc_s <= LAST_UTC_S):
        raise _damage_error(path, 1, "began_s, ended_s, at_s, utc_s, causes")
    if not 0 < header.lines <= MOST_LINES:
        raise _damage_error(path, 1, "lines")
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


def _damage_error(path: Path, line: int, why: str) -> ProfileError:
    value = printable(" ".join(why.split()), 160)
    return ProfileError(Problem(code="flight.damaged", where=printable(str(path)), key=str(line), value=value))
