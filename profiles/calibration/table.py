"""Read a table of measurements as exported by a spreadsheet.

Cells are separated by semicolons, tabs or commas; with the first two, numbers may have a decimal comma
(`profiles.trace_files.number_marks`). The header names the columns with their units ("Torque (N m)" is the key
`torque_n_m`); lines `# key: value` before it apply to all rows. A byte order mark, quotes, empty lines and
trailing empty cells are accepted. Unknown columns are skipped and reported. Anything else is refused with its
line, all problems (up to a cap) at once.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from profiles.arrays import Floats
from profiles.fields import Field, fault
from profiles.files import printable, read_regular_file
from profiles.problem import Problem, ProfileError
from profiles.trace_files.limits import text_of
from profiles.trace_files.number_marks import DECIMAL_SIGNS, SPOILING, NumberMarks, describe_readings
from profiles.trace_files.table import split_cells

CAP_BYTES = 10_000_000
MOST_ROWS = 10_000  # a year of clampings, one every hour
_PROBLEM_CAP = 20
_SEPARATORS = (";", "\t", ",")


class CalibrationKind(StrEnum):
    """The kind of table: force by wrench torque, or deflection by force, load, angle and size."""

    WRENCH = "wrench"
    DEFLECTION = "deflection"


COLUMNS: Mapping[CalibrationKind, tuple[Field, ...]] = {
    CalibrationKind.WRENCH: (
        Field(key="torque_n_m", unit="N m", above=0, at_most=10_000),
        Field(key="force_n", unit="N", above=0, at_most=1_000_000),
    ),
    CalibrationKind.DEFLECTION: (
        Field(key="chucking_force_n", unit="N", above=0, at_most=1_000_000),
        Field(key="load_n", unit="N", above=0, at_most=100_000),
        Field(key="angle_deg", unit="deg", at_least=-360, at_most=360),
        Field(key="diameter_mm", unit="mm", above=0, at_most=1000),
        Field(key="overhang_mm", unit="mm", at_least=0, at_most=2000),
        Field(key="deflection_um", unit="um", above=0, at_most=100_000),
    ),
}
"""The columns of each kind. Forces of the chuck are totals over all jaws; angles count from a jaw."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredTable:
    """M rows of measurements. `columns` have shape (M,) each; `lines` are their line numbers in the file.

    `meta` are the values of the `# key: value` lines, `ignored` the columns that were not used,
    `numbers_read` the example of its `NumberMarks`.
    """

    kind: CalibrationKind
    columns: Mapping[str, Floats]
    lines: tuple[int, ...]
    meta: Mapping[str, str]
    ignored: tuple[str, ...]
    sha256: str
    numbers_read: str = ""


def read_table(path: Path, kind: CalibrationKind | None = None) -> MeasuredTable:
    """Read the measurements in a file; without a `kind`, of the one whose columns it has.

    Raises `ProfileError`: every problem of it.
    """
    content = read_regular_file(path, cap_bytes=CAP_BYTES, area="calibration")
    return parse_table(content, kind, where=printable(str(path)))


def parse_table(content: bytes, kind: CalibrationKind | None = None, *, where: str = "") -> MeasuredTable:
    """Parse the measurements in the bytes of a file; `where` names it in the problems."""
    text = text_of(content, where, "calibration.not_text")
    reader = _CalibrationTableReader(where, tuple(CalibrationKind) if kind is None else (kind,), text)
    for number, line in enumerate(text.split("\n"), start=1):
        stripped = line.strip(" \r")
        if stripped.strip(";,\t"):
            reader.take(number, stripped)
        if reader.full or len(reader.problems) >= _PROBLEM_CAP:
            break
    return reader.to_table(hashlib.sha256(content).hexdigest())


def column_name(header: str) -> str:
    """Return a heading as a key: "Torque [N·m]" and "torque Nm" are `torque_n_m`."""
    plain = header.strip().lower().replace("µ", "u").replace("μ", "u").replace("°", "deg")
    return re.sub(r"_nm$", "_n_m", re.sub(r"[^a-z0-9]+", "_", plain).strip("_"))


class _CalibrationTableReader:
    def __init__(self, where: str, kinds: tuple[CalibrationKind, ...], text: str) -> None:
        self.problems: list[Problem] = []
        self.full = False
        self._where = where
        self._kinds = kinds
        self._text = text
        self._kind: CalibrationKind | None = None
        self._separator = ""
        self._names: list[str] = []
        self._ignored: tuple[str, ...] = ()
        self._meta: dict[str, str] = {}
        self._rows: list[list[float]] = []
        self._lines: list[int] = []
        self._marks = NumberMarks("", None, str)

    def take(self, number: int, line: str) -> None:
        if line.startswith("#"):
            if not self._names:
                self._take_meta(number, line.rstrip(";,\t"))
        elif not self._names:
            self._take_header(number, line)
        elif self._kind is not None:
            self._take_row(number, line, self._kind)

    def to_table(self, sha256: str) -> MeasuredTable:
        if not self._names and not self.problems:
            self.problems.append(Problem(code="calibration.empty", where=self._where, limit=self._target()))
        if self.problems or self._kind is None:
            raise ProfileError(*self.problems)
        fields = COLUMNS[self._kind]
        values = np.array(self._rows, dtype=np.float64).reshape(-1, len(fields))
        return MeasuredTable(
            kind=self._kind,
            columns={field.key: values[:, place] for place, field in enumerate(fields)},
            lines=tuple(self._lines),
            meta=self._meta,
            ignored=self._ignored,
            sha256=sha256,
            numbers_read=self._marks.example,
        )

    def _take_meta(self, number: int, line: str) -> None:
        key, colon, value = (part.strip() for part in line.lstrip("#").partition(":"))
        if not colon:
            return  # a remark
        name = column_name(key)
        unusable_sign = name == "decimal" and value not in DECIMAL_SIGNS
        if not name or name in self._meta or not value.isprintable() or unusable_sign:
            limit = f"# decimal: {' | '.join(DECIMAL_SIGNS)}" if unusable_sign else "# key: value"
            self._refuse("calibration.meta", number, value=line, limit=limit)
            return
        self._meta[name] = value

    def _take_header(self, number: int, line: str) -> None:
        for separator in _SEPARATORS:
            names = [column_name(cell) for cell in split_cells(line, separator)]
            for kind in self._kinds:
                target = [field.key for field in COLUMNS[kind]]
                if all(names.count(key) == 1 for key in target):
                    self._kind, self._separator, self._names = kind, separator, names
                    self._ignored = tuple(name for name in names if name and name not in target)
                    decimal = self._meta.get("decimal")
                    self._marks = NumberMarks(separator, decimal, lambda: self._text.partition(line)[2])
                    return
        self._names = ["-"]  # the header was found, but is unusable: the rows are not judged
        self._refuse("calibration.columns", number, value=line, limit=self._target())

    def _take_row(self, number: int, line: str, kind: CalibrationKind) -> None:
        if len(self._rows) >= MOST_ROWS:
            self.full = True
            self._refuse(
                "calibration.too_large", number, value=f"> {MOST_ROWS} rows", limit=f"<= {MOST_ROWS} rows"
            )
            return
        cells = split_cells(line, self._separator)
        while len(cells) > len(self._names) and not cells[-1]:
            cells.pop()
        if len(cells) != len(self._names):
            self._refuse("calibration.cells", number, value=str(len(cells)), limit=str(len(self._names)))
            return
        row = []
        for field in COLUMNS[kind]:
            cell = cells[self._names.index(field.key)]
            value, code = self._marks.read(cell)
            if code in SPOILING and code != "trace.decimal_comma":
                self.full = True
                two = code == "value.two_readings"
                limit, mixed = describe_readings(cell) if two else field.limit, "calibration.mixed_decimals"
                self._refuse(code if two else mixed, number, key=field.key, value=cell, limit=limit)
                return
            if code:
                self._refuse("calibration.not_number", number, key=field.key, value=cell, limit=field.limit)
            elif fault(field, value):
                self._refuse("calibration.out_of_range", number, key=field.key, value=cell, limit=field.limit)
            else:
                row.append(value)
        if len(row) == len(COLUMNS[kind]):
            self._rows.append(row)
            self._lines.append(number)

    def _target(self) -> str:
        return " | ".join(",".join(field.key for field in COLUMNS[kind]) for kind in self._kinds)

    def _refuse(self, code: str, number: int, *, key: str = "", value: str = "", limit: str = "") -> None:
        where, shown = f"{self._where}:{number}", printable(value, 60)
        self.problems.append(Problem(code=code, where=where, key=key, value=shown or '""', limit=limit))
