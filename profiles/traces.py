"""Reading and writing roundness traces as CSV.

The file is UTF-8 text: lines `# key: value` in any number, the header `angle_deg,deviation_um`, and one point
a line, with angles in [0, 360) and each angle once. A last point at 360 that repeats the one at 0 closes the
turn and is left out. Blank lines, lines that start with `#` (after the first point they are remarks and no more),
spaces, quoted cells, a byte order mark and either kind of line end are taken; anything else is refused with its
line number, all problems (up to a cap) at once. A cause that spoils every line, such as decimal commas, is told
once and alone.

Problem codes: `trace.unreadable`, `trace.too_large`, `trace.not_utf8`, `trace.no_header`, `trace.columns`,
`trace.not_number`, `trace.not_finite`, `trace.out_of_range`, `trace.duplicate_angle`, `trace.few_points`,
`trace.meta`; of the whole file `trace.separator`, `trace.decimal_comma`, `trace.negative_angle`; for writing
`file.exists` and `file.not_writable`.
"""

from __future__ import annotations

import csv
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
# How far the point that closes the turn at 360 deg may be from the one at 0, for the rounding of a file.
CLOSING_TOLERANCE_UM = 1e-9
_PROBLEM_CAP = 20
_TURN_DEG = 360.0
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+", re.ASCII)
_WHOLE_NUMBER = re.compile(r"[+-]?\d+", re.ASCII)
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
        value = f"0x{content[error.start]:02x}"
        raise ProfileError(Problem(code="trace.not_utf8", where=f"{where}:{line}", value=value)) from error
    reader = _Reader(where)
    for number, line_text in enumerate(text.split("\n"), start=1):
        stripped = line_text.strip(" \t\r")
        if stripped:
            reader.take(number, stripped)
        if reader.spoilt or len(reader.problems) >= _PROBLEM_CAP:
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
    met = parse_trace(content, where=where).meta
    for key, value in trace.meta.items():
        if met.get(key) != value:
            shown = printable(f"# {key}: {value}", 60)
            raise ProfileError(Problem(code="trace.meta", where=where, value=shown, limit="# key: value"))
    write_atomically(path, content, overwrite=overwrite)


class _Reader:
    """Takes the lines of one file in turn; collects points and problems."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.problems: list[Problem] = []
        self.spoilt = False
        self._meta: dict[str, str] = {}
        self._header_met = False
        self._line_of_angle: dict[float, int] = {}
        self._deviations: list[float] = []
        self._closed = False

    def take(self, number: int, line: str) -> None:
        if line.startswith("#"):
            if not self._line_of_angle:
                self._take_meta(number, line)
            return
        cells = _cells(line)
        if cause := _cause(cells):
            self._spoil(cause, number, value=line)
        elif not self._header_met:
            self._header_met = True
            if tuple(cells) != HEADER:
                code = "trace.no_header" if _is_point(cells) else "trace.columns"
                self._refuse(code, number, value=line, limit=",".join(HEADER))
        elif len(cells) != len(HEADER):
            self._refuse("trace.columns", number, value=line, limit=",".join(HEADER))
        else:
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

    def _take_meta(self, number: int, line: str) -> None:
        key, colon, value = (part.strip() for part in line[1:].partition(":"))
        if not colon:
            return  # a remark for people
        if not key or key in self._meta or not (key + value).isprintable():
            self._refuse("trace.meta", number, value=line, limit="# key: value")
            return
        self._meta[key] = value

    def _take_point(self, number: int, cells: Sequence[str]) -> None:
        values = []
        for key, cell in zip(HEADER, cells, strict=True):
            value, code = _number(cell)
            within = 0 <= value <= _TURN_DEG if key == HEADER[0] else abs(value) <= LARGEST_DEVIATION_UM
            if not code and key == HEADER[0] and value < 0:
                self._spoil("trace.negative_angle", number, value=cell)
                return
            if code or not within:
                limit = ">= 0, < 360 deg" if key == HEADER[0] else f"<= {LARGEST_DEVIATION_UM:g} um"
                self._refuse(code or "trace.out_of_range", number, key=key, value=cell, limit=limit)
                return
            values.append(value)
        self._keep_point(number, cells[0], *values)

    def _keep_point(self, number: int, cell: str, angle: float, deviation: float) -> None:
        closes = angle == _TURN_DEG
        if closes and 0.0 not in self._line_of_angle:
            self._refuse("trace.out_of_range", number, key=HEADER[0], value=cell, limit=">= 0, < 360 deg")
            return
        place = 0.0 if closes else angle
        if place not in self._line_of_angle:
            self._line_of_angle[angle] = number
            self._deviations.append(deviation)
            return
        if closes and not self._closed and self._repeats_zero(deviation):
            self._closed = True
            return
        limit = f"{self.where}:{self._line_of_angle[place]}"
        self._refuse("trace.duplicate_angle", number, key=HEADER[0], value=cell, limit=limit)

    def _repeats_zero(self, deviation: float) -> bool:
        at_zero = self._deviations[list(self._line_of_angle).index(0.0)]
        return abs(deviation - at_zero) <= CLOSING_TOLERANCE_UM

    def _spoil(self, code: str, number: int, *, value: str) -> None:
        """Refuse the whole file for a cause that is on every line of it."""
        self.spoilt = self._header_met = True
        self.problems.clear()
        self._refuse(code, number, value=value, limit=",".join(HEADER))

    def _refuse(self, code: str, number: int, *, key: str = "", value: str = "", limit: str = "") -> None:
        where, shown = f"{self.where}:{number}", printable(value, 60)
        self.problems.append(Problem(code=code, where=where, key=printable(key, 60), value=shown, limit=limit))


def _cells(line: str) -> list[str]:
    cells = line.split(",")
    if '"' in line:
        try:
            cells = next(csv.reader([line], skipinitialspace=True))
        except csv.Error:  # then the quotes are no quotes, and the cells are refused as they stand
            pass
    return [cell.strip() for cell in cells]


def _cause(cells: Sequence[str]) -> str:
    """Return the code of a cause that spoils a whole file, "" where the line shows none."""
    if any(mark in cell for mark in (";", "\t") for cell in cells):
        return "trace.separator"
    if any(_COMMA_NUMBER.fullmatch(cell) for cell in cells):
        return "trace.decimal_comma"
    split = len(HEADER) < len(cells) <= 2 * len(HEADER) and all(_WHOLE_NUMBER.fullmatch(cell) for cell in cells)
    return "trace.decimal_comma" if split else ""


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
