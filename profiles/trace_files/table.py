"""One text file with a table of points: its column names, the separator of its lines, read line by line.

The separator is detected from the header line and required on every line: a semicolon, a comma, a tab or blanks.
Column names are those of instruments and spreadsheets: "Angle [deg]", "θ (°)", "Deviation / µm", "편차 [um]".
"""

from __future__ import annotations

import csv
import re
import unicodedata
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.trace_files.header import APPLIED, NUMBERS_READ
from profiles.trace_files.limits import MOST_HEADER_LINES, MOST_POINTS
from profiles.trace_files.number_marks import (
    DECIMAL_SIGNS,
    SPOILING,
    NumberMarks,
    describe_readings,
    number_readings,
)

FEWEST_POINTS = 16
LARGEST_DEVIATION_UM = 1e6
LARGEST_PLACE_UM = 1e7
MOST_TURNS = 1000
UM_PER_UNIT: Mapping[str, float] = {"um": 1.0, "mm": 1000.0, "nm": 0.001}
ANGLE = "angle_deg"


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """One kind of table: the names of its columns in order, and the unit of their numbers in um.

    `um_per_unit` is 0 where the header has to say it (`# units: mm`). `plane` are points x, y; otherwise there are
    angles, or the header says that they are equal (`# angles: equal`), and deviations.
    """

    names: tuple[str, ...]
    um_per_unit: float
    plane: bool = False


TABLES = (
    *(Columns(names=(ANGLE, f"deviation_{unit}"), um_per_unit=um) for unit, um in UM_PER_UNIT.items()),
    Columns(names=(ANGLE, "deviation"), um_per_unit=0.0),
    *(Columns(names=(f"deviation_{unit}",), um_per_unit=um) for unit, um in UM_PER_UNIT.items()),
    Columns(names=("deviation",), um_per_unit=0.0),
    Columns(names=("x_mm", "y_mm"), um_per_unit=1000.0, plane=True),
)

_QUANTITIES: Mapping[str, str] = {
    **dict.fromkeys(("angle", "spindle_angle", "theta", "phi", "θ", "φ", "각도"), "angle"),
    **dict.fromkeys(
        ("deviation", "dev", "radial_deviation", "roundness_deviation", "delta_r", "δr", "편차"), "deviation"
    ),
    **{axis: axis for axis in "xy"},
    **dict.fromkeys(("z", "height", "높이"), "z"),
}
_UNITS: Mapping[str, str] = {
    **dict.fromkeys(("deg", "degree", "degrees", "°", "도"), "deg"),
    **dict.fromkeys(("um", "micron", "microns", "micrometer", "micrometers", "micrometre", "micrometres"), "um"),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("nm", "nanometer", "nanometers", "nanometre", "nanometres"), "nm"),
}

_WHOLE_NUMBER = re.compile(r"[+-]?\d+", re.ASCII)


def columns_named(headings: tuple[str, ...]) -> Columns | None:
    """Return the kind of table with these columns, None where there is none."""
    names = tuple(column_name(heading) for heading in headings)
    return next((table for table in TABLES if table.names == names), None)


def column_name(heading: str) -> str:
    """Return a heading as `TABLES` spells it, such as `deviation_um`; an unknown one as its words."""
    words = re.findall(r"°|[^\W_]+", _plain(heading))
    unit = _UNITS.get(words[-1]) if len(words) > 1 else None
    quantity = "_".join(words[:-1] if unit else words)
    return "_".join(part for part in (_QUANTITIES.get(quantity, quantity), unit) if part)


def unit_named(stated: str) -> str:
    """Return a unit in our spelling, such as "um" for "µm"; an unknown word as it is."""
    return _UNITS.get(_plain(stated), stated)


def _plain(text: str) -> str:
    """Return lower case with one of the two look-alike signs for micro."""
    return unicodedata.normalize("NFKC", text.strip()).lower().replace("μ", "u")


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line without surrounding blanks and quotes."""
    cells = line.split(separator)
    if '"' in line:
        with suppress(csv.Error):  # then the quotes are not quotes, and the cells are refused as they are
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [cell.strip() for cell in cells]


class ColumnFormat:
    """The separator of one file."""

    def __init__(self, header: str) -> None:
        """Detect the separator in the header line; the names of columns contain none of its characters.

        Between blanks a unit in brackets belongs to the name before it.
        """
        self.separator = next((mark for mark in ";,\t" if mark in header), " ")
        self.header = re.sub(r"\s+(?=[\[(])", "", header) if self.separator == " " else header

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line without surrounding blanks and quotes."""
        return line.split() if self.separator == " " else split_cells(line, self.separator)

    def cause(self, cells: Sequence[str], target: int) -> str:
        """Return the code of a fault that spoils a whole file, "" where the line shows none."""
        others = [mark for mark in ";\t" if mark != self.separator]
        if any(mark in cell for mark in others for cell in cells):
            return "trace.separator"
        if self.separator == ",":
            split = target < len(cells) <= 2 * target and all(_WHOLE_NUMBER.fullmatch(cell) for cell in cells)
            return "trace.decimal_comma" if split and target > 1 else ""
        return "trace.separator" if len(cells) == 1 < target and "," in cells[0] else ""

    def is_point(self, cells: Sequence[str]) -> bool:
        """Whether these are numbers and not names."""
        return all(map(number_readings, cells))


PLAIN_HEADER = ",".join(TABLES[0].names)
HEADERS = f"{PLAIN_HEADER} | {','.join(TABLES[-1].names)}"
# How far the point that closes the turn at 360 deg may be from the one at 0, to allow for rounding in a file.
CLOSING_TOLERANCE_UM = 1e-9
PROBLEM_CAP = 20
_TURN_DEG = 360.0
_RANGES = {"0..360": 0.0, "-180..180": -180.0}
_CHOICES = {
    "units": (*UM_PER_UNIT,),
    "angles": ("equal",),
    "angle_range": (*_RANGES,),
    "decimal": (*DECIMAL_SIGNS,),
}


class TraceTableReader:
    """Reads the lines of one file in turn; collects problems and points: first column, second column in um.

    `scattered` points are of no one turn: an angle or a place may come again, and angles run on.
    """

    def __init__(self, where: str, text: str, *, scattered: bool = False) -> None:
        self.where = where
        self._scattered = scattered
        self._text = text
        self.problems: list[Problem] = []
        self.spoilt = False
        self.meta: dict[str, str] = {}
        self.columns: Columns | None = None
        self.first: list[float] = []
        self.second: list[float] = []
        self._header_seen = False
        self._dialect = ColumnFormat("")
        self._marks = NumberMarks("", None, str)
        self._line_of_angle: dict[float, int] = {}
        self._line_of_place: dict[tuple[float, float], int] = {}
        self._closed_by: tuple[int, str] | None = None
        self._um_per_unit = 0.0
        self._from_deg, self._to_deg = 0.0, _TURN_DEG * (MOST_TURNS if scattered else 1)
        self._closed = False

    def take(self, number: int, line: str) -> None:
        """Process one line that is not blank, without surrounding blanks."""
        if line.startswith("#"):
            if not self.second:
                self._take_meta(number, line)
            return
        if not self._header_seen:
            self._dialect = ColumnFormat(line)
            self._take_header(number, line, self._dialect.cells(self._dialect.header))
            return
        cells = self._dialect.cells(line)
        target = 2 if self.columns is None else len(self.columns.names)
        if cause := self._dialect.cause(cells, target):
            self._spoil(cause, number, value=line, limit=PLAIN_HEADER)
        elif len(self.second) >= MOST_POINTS:
            value, limit = f"> {MOST_POINTS} points", f"<= {MOST_POINTS} points"
            self._spoil("trace.too_large", number, value=value, limit=limit)
        elif len(cells) != target:
            names = TABLES[0].names if self.columns is None else self.columns.names
            self._refuse("trace.columns", number, value=line, limit=",".join(names))
        else:
            self._take_point(number, cells)

    def finish(self) -> None:
        """Raise `ProfileError` with all problems, if there are any; forget the keys that were applied."""
        if not self._header_seen:
            self.problems.append(Problem(code="trace.no_header", where=self.where, limit=PLAIN_HEADER))
        if not self.problems and len(self.second) < FEWEST_POINTS:
            value, limit = str(len(self.second)), f">= {FEWEST_POINTS}"
            self.problems.append(Problem(code="trace.few_points", where=self.where, value=value, limit=limit))
        if self.problems:
            raise ProfileError(*self.problems)
        self.meta = {key: value for key, value in self.meta.items() if key not in APPLIED}
        self.meta |= {NUMBERS_READ: self._marks.example} if self._marks.example else {}

    def _take_meta(self, number: int, line: str) -> None:
        key, colon, value = (part.strip() for part in line[1:].partition(":"))
        if not colon:
            return  # a remark
        value = unit_named(value) if key == "units" else value
        if not key or key in self.meta or not (key + value).isprintable():
            self._refuse("trace.meta", number, value=line, limit="# key: value")
            return
        if len(self.meta) >= MOST_HEADER_LINES:
            value, limit = f"> {MOST_HEADER_LINES} # lines", f"<= {MOST_HEADER_LINES} # lines"
            self._spoil("trace.too_large", number, value=value, limit=limit)
            return
        self.meta[key] = value
        allowed = _CHOICES.get(key)
        if self._header_seen and allowed:
            self._refuse("trace.meta_late", number, key=key, value=line, limit=PLAIN_HEADER)
        elif allowed and value not in allowed:
            self._spoil("trace.key", number, key=key, value=value, limit=", ".join(allowed))
        elif key == "turns":
            self._take_turns(number, value)
        elif key == "angle_range" and _RANGES[value] != 0.0:
            if self._to_deg != _TURN_DEG:
                self._spoil("trace.key", number, key=key, value=value, limit="0..360")
            self._from_deg = _RANGES[value]
            self._to_deg = self._from_deg + _TURN_DEG

    def _take_turns(self, number: int, value: str) -> None:
        if not (value.isascii() and value.isdigit() and len(value) < 5 and 1 <= int(value) <= MOST_TURNS):
            self._spoil("trace.key", number, key="turns", value=value, limit=f"1 - {MOST_TURNS}")
        elif self._from_deg != 0.0:
            self._spoil("trace.key", number, key="turns", value=value, limit="angle_range: 0..360")
        else:
            self._to_deg = _TURN_DEG * int(value)

    def _take_header(self, number: int, line: str, cells: Sequence[str]) -> None:
        self._header_seen = True
        self.columns = columns_named(tuple(cells))
        if self.columns is None:
            code = "trace.no_header" if self._dialect.is_point(cells) else "trace.columns"
            self._refuse(code, number, value=line, limit=HEADERS)
            self.spoilt = True  # nothing is known of the following lines
            return
        stated = self.meta.get("units")
        self._um_per_unit = self.columns.um_per_unit or UM_PER_UNIT.get(stated or "", 0.0)
        if not self._um_per_unit or (stated and UM_PER_UNIT.get(stated) != self._um_per_unit):
            self._spoil("trace.units", number, value=line, limit=" | ".join(f"# units: {u}" for u in UM_PER_UNIT))
        elif (len(cells) == 1) != (self.meta.get("angles") == "equal"):
            self._spoil("trace.angles", number, value=line, limit="# angles: equal")
        decimal = self.meta.get("decimal")
        self._marks = NumberMarks(self._dialect.separator, decimal, lambda: self._text.partition(line)[2])

    def _take_point(self, number: int, cells: Sequence[str]) -> None:
        assert self.columns is not None
        values = []
        for key, cell in zip(self.columns.names, cells, strict=True):
            value, code = self._marks.read(cell)
            if code in SPOILING:
                limit = describe_readings(cell) if code == "value.two_readings" else PLAIN_HEADER
                self._spoil(code, number, key=key, value=cell, limit=limit)
                return
            if key != ANGLE:
                value *= self._um_per_unit
            elif not code and value < self._from_deg == 0.0:
                self._spoil("trace.negative_angle", number, value=cell, limit="")
                return
            within, limit = self._check_range(key, value)
            if not (code or within or key == ANGLE):  # each of the other lines would be, too
                self._spoil("trace.beyond", number, key=key, value=cell, limit=limit)
                return
            if code or not within:
                self._refuse(code or "trace.out_of_range", number, key=key, value=cell, limit=limit)
                return
            values.append(value)
        if self._scattered and len(values) > 1:
            self.first.append(values[0])
            self.second.append(values[1])
        elif self.columns.names[0] == ANGLE:
            self._keep_point(number, cells[0], *values)
        elif self.columns.plane:
            self._keep_place(number, cells, values[0], values[1])
        else:
            self.first.append(float(len(self.second)))
            self.second.append(values[0])

    def _check_range(self, key: str, value: float) -> tuple[bool, str]:
        if key == ANGLE:
            limit = f">= {self._from_deg:g}, < {self._to_deg:g} deg"
            return self._from_deg <= value <= self._to_deg, limit
        assert self.columns is not None
        largest_um = LARGEST_PLACE_UM if self.columns.plane else LARGEST_DEVIATION_UM
        unit = next(unit for unit, um in UM_PER_UNIT.items() if um == self._um_per_unit)
        return abs(value) <= largest_um, f"<= {largest_um / self._um_per_unit:.10g} {unit}"

    def _keep_point(self, number: int, cell: str, angle: float, deviation: float) -> None:
        closes = angle == self._to_deg
        if closes and (self._from_deg not in self._line_of_angle or self._to_deg > _TURN_DEG):
            limit = self._check_range(ANGLE, angle)[1]
            self._refuse("trace.out_of_range", number, key=ANGLE, value=cell, limit=limit)
            return
        place = self._from_deg if closes else angle
        if place not in self._line_of_angle:
            self._line_of_angle[place] = number
            self.first.append(angle if angle >= 0.0 else angle % _TURN_DEG)
            self.second.append(deviation)
            return
        if closes and not self._closed:
            at_start = self.second[list(self._line_of_angle).index(self._from_deg)]
            self._closed = abs(deviation - at_start) <= CLOSING_TOLERANCE_UM
            if self._closed:
                return
        limit = f"{self.where}:{self._line_of_angle[place]}"
        self._refuse("trace.duplicate_angle", number, key=ANGLE, value=cell, limit=limit)

    def _keep_place(self, number: int, cells: Sequence[str], x_um: float, y_um: float) -> None:
        """Keep a point in the plane; a last point equal to the first closes the turn and is left out."""
        if self._closed_by:  # then it was not the last
            self._refuse_place(*self._closed_by, self._line_of_place[self.first[0], self.second[0]])
            self._closed_by = None
        before = self._line_of_place.setdefault((x_um, y_um), number)
        if before == number:
            self.first.append(x_um)
            self.second.append(y_um)
        elif (x_um, y_um) == (self.first[0], self.second[0]):
            self._closed_by = (number, ",".join(cells))
        else:
            self._refuse_place(number, ",".join(cells), before)

    def _refuse_place(self, number: int, shown: str, before: int) -> None:
        key = ",".join(self.columns.names) if self.columns else ""
        self._refuse("trace.duplicate_point", number, key=key, value=shown, limit=f"{self.where}:{before}")

    def _spoil(self, code: str, number: int, *, key: str = "", value: str, limit: str) -> None:
        """Refuse the whole file for a fault that is on every line of it."""
        self.spoilt = self._header_seen = True
        self.problems.clear()
        self._refuse(code, number, key=key, value=value, limit=limit)

    def _refuse(self, code: str, number: int, *, key: str = "", value: str = "", limit: str = "") -> None:
        where, shown = f"{self.where}:{number}", printable(value, 60)
        self.problems.append(Problem(code=code, where=where, key=printable(key, 60), value=shown, limit=limit))
