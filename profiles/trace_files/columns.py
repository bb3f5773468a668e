"""The tables that a trace file may hold, told by the names of its columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

UM_PER_UNIT: Mapping[str, float] = {"um": 1.0, "mm": 1000.0, "nm": 0.001}
ANGLE = "angle_deg"


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """One kind of table: the names of its columns in order, and what their numbers are in um.

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


def columns_named(names: tuple[str, ...]) -> Columns | None:
    """Return the kind of table with these columns, None where there is none."""
    return next((table for table in TABLES if table.names == names), None)
