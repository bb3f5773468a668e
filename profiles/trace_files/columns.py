"""The tables that a trace file may hold, identified by their column names.

Column names are those of instruments and spreadsheets: "Angle [deg]", "θ (°)", "Deviation / µm", "편차 [um]".
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass

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
