"""Reading and writing roundness traces as CSV.

The file is UTF-8 text: lines `# key: value` in any number, the header `angle_deg,deviation_um`, and one point
a line, with angles in [0, 360) and each angle once. Blank lines, spaces, a byte order mark and either kind of
line end are taken; anything else is refused with its line number, all problems (up to a cap) at once.

Problem codes: `trace.unreadable`, `trace.too_large`, `trace.not_utf8`, `trace.no_header`, `trace.columns`,
`trace.not_number`, `trace.not_finite`, `trace.out_of_range`, `trace.duplicate_angle`, `trace.few_points`,
`trace.meta`; for writing `file.exists` and `file.not_writable`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from profiles.files import printable, read_regular_file, write_atomically
from profiles.problem import Problem, ProfileError

CAP_BYTES = 50_000_000
FEWEST_POINTS = 16
LARGEST_DEVIATION_UM = 1e6
HEADER = ("angle_deg", "deviation_um")
_PROBLEM_CAP = 20
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WORDS_FOR_NO_NUMBER = frozenset({"nan", "inf", "infinity"})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """A measured profile: M spindle angles in deg and M deviations in um, positive outwards; shape (M,) each.

    `meta` holds the `# key: value` lines. Both arrays are read only.
    """

    angle_deg: NDArray[np.float64]
    deviation_um: NDArray[np.float64]
    meta: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


def read_trace(path: Path) -> Trace:
    """Return the trace in a CSV file, or raise `ProfileError` with its problems."""
    content = read_regular_file(path, cap_bytes=CAP_BYTES, area="trace")
    return parse_trace(content, where=printable(str(path)))


def parse_trace(content: bytes, *, where: str = "") -> Trace:
    """Return the trace in the bytes of a CSV file; `where` names them in the problems."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ProfileError(Problem(code="trace.not_utf8", where=f"{where}:{line}")) from error
    reader = _Reader(where)
    for number, line_text in enumerate(text.split("\n"), start=1):
        stripped = line_text.strip(" \t\r")
        if stripped:
            reader.take(number, stripped)
        if len(reader.problems) >= _PROBLEM_CAP:
            break
    return reader.finished()


def write_trace(path: Path, trace: Trace, *, overwrite: bool = False) -> None:
    """Write a trace so that reading it gives the same numbers, bit by bit.

    Raises `ProfileError` where the result could not be read back, and `file.exists` or `file.not_writable`.
    """
    where = printable(str(path))
    if trace.angle_deg.ndim != 1 or trace.angle_deg.shape != trace.deviation_um.shape:
        value = f"{trace.angle_deg.shape} {trace.deviation_um.shape}"
        raise ProfileError(Problem(code="trace.columns", where=where, value=value, limit="(M,) (M,)"))
    lines = [f"# {key}: {value}" for key, value in trace.meta.items()]
    lines.append(",".join(HEADER))
    pairs = zip(trace.angle_deg.tolist(), trace.deviation_um.tolist(), strict=True)
    lines.extend(f"{angle!r},{deviation!r}" for angle, deviation in pairs)
    # What cannot be encoded becomes a question mark, and the comparison below refuses it.
    content = ("\n".join(lines) + "\n").encode("utf-8", errors="replace")
    if dict(parse_trace(content, where=where).meta) != dict(trace.meta):
        raise ProfileError(Problem(code="trace.meta", where=where, limit="key: value"))
    write_atomically(path, content, overwrite=overwrite)


class _Reader:
    """Takes the lines of one file in turn; collects points and problems."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.problems: list[Problem] = []
        self._meta: dict[str, str] = {}
        self._header_met = False
        self._line_of_angle: dict[float, int] = {}
        self._deviations: list[float] = []

    def take(self, number: int, line: str) -> None:
        if line.startswith("#") and not self._line_of_angle:
            self._take_meta(number, line[1:])
            return
        cells = [cell.strip() for cell in line.split(",")]
        if not self._header_met:
            self._header_met = True
            if tuple(cells) != HEADER:
                code = "trace.no_header" if _is_point(cells) else "trace.columns"
                self._refuse(code, number, value=line, limit=",".join(HEADER))
            return
        if len(cells) != len(HEADER):
            self._refuse("trace.columns", number, value=line, limit=",".join(HEADER))
            return
        self._take_point(number, cells)

    def finished(self) -> Trace:
        if not self._header_met:
            self.problems.append(Problem(code="trace.no_header", where=self.where, limit=",".join(HEADER)))
        if not self.problems and len(self._deviations) < FEWEST_POINTS:
            value = str(len(self._deviations))
            self.problems.append(
                Problem(code="trace.few_points", where=self.where, value=value, limit=f">= {FEWEST_POINTS}")
            )
        if self.problems:
            raise ProfileError(*self.problems)
        return Trace(
            angle_deg=_read_only(list(self._line_of_angle)),
            deviation_um=_read_only(self._deviations),
            meta=MappingProxyType(self._meta),
        )

    def _take_meta(self, number: int, text: str) -> None:
        key, colon, value = (part.strip() for part in text.partition(":"))
        if not colon:
            return  # a remark for people
        if not key or key in self._meta or not (key + value).isprintable():
            self._refuse("trace.meta", number, key=key, value=value)
            return
        self._meta[key] = value

    def _take_point(self, number: int, cells: Sequence[str]) -> None:
        values = []
        for key, cell in zip(HEADER, cells, strict=True):
            value, code = _number(cell)
            if not code and key == HEADER[0] and not 0 <= value < 360:
                code = "trace.out_of_range"
            if not code and key == HEADER[1] and abs(value) > LARGEST_DEVIATION_UM:
                code = "trace.out_of_range"
            if code:
                limit = ">= 0, < 360 deg" if key == HEADER[0] else f"<= {LARGEST_DEVIATION_UM:g} um"
                self._refuse(code, number, key=key, value=cell, limit=limit)
            values.append(value)
            if code:
                return
        angle, deviation = values
        if angle in self._line_of_angle:
            limit = f"{self.where}:{self._line_of_angle[angle]}"
            self._refuse("trace.duplicate_angle", number, key=HEADER[0], value=cells[0], limit=limit)
            return
        self._line_of_angle[angle] = number
        self._deviations.append(deviation)

    def _refuse(self, code: str, number: int, *, key: str = "", value: str = "", limit: str = "") -> None:
        where, shown = f"{self.where}:{number}", printable(value, 60)
        self.problems.append(Problem(code=code, where=where, key=printable(key, 60), value=shown, limit=limit))


def _is_point(cells: Sequence[str]) -> bool:
    return all(_NUMBER.fullmatch(cell) for cell in cells)


def _number(cell: str) -> tuple[float, str]:
    """Return a number and the problem code of what is none; Python's own reading would take 1_000 too."""
    if cell.lstrip("+-").lower() in _WORDS_FOR_NO_NUMBER:
        return math.nan, "trace.not_finite"
    if len(cell) > 60 or not _NUMBER.fullmatch(cell):
        return math.nan, "trace.not_number"
    value = float(cell)
    return value, "" if math.isfinite(value) else "trace.not_finite"


def _read_only(values: list[float]) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
