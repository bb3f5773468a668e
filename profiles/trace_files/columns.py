"""The tables that a trace file may hold, by their column names, and the separator of their lines.

The separator is detected from the header line and required on every line: a semicolon, a comma, a tab or blanks.
Column names are those of instruments and spreadsheets: "Angle [deg]", "θ (°)", "Deviation / µm", "편차 [um]".
"""

from __future__ import annotations

import csv
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from profiles.trace_files.number_marks import number_readings

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


class Dialect:
    """The separator of one file."""

    def __init__(self, header: str) -> None:
        """Detect the separator in the header line; the names of columns contain none of its characters.

        Between blanks a unit in brackets belongs to the name before it.
        """
        self.separator = next((mark for mark in ";,\t" if mark in header), " ")
        self.header = re.sub(r"\s+(?=[\[(])", "", header) if self.separator == " " else header

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line without surrounding blanks and quotes."""
        if self.separator == " ":
            return line.split()
        cells = line.split(self.separator)
        if '"' in line:
            try:
                cells = next(csv.reader([line], delimiter=self.separator, skipinitialspace=True))
            except csv.Error:  # then the quotes are not quotes, and the cells are refused as they are
                pass
        return [cell.strip() for cell in cells]

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
