"""Measured points that are not kept yet: entered one by one, or imported from a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.calibrations import FOLDER
from console.session.data.kept_files import folder_name, make_folder, utc_now
from console.session.learning.chuck_calibrating import stated_number
from console.session.typed_number import stored_length
from console.session.work import entered_number
from console.units import METRIC, Units
from profiles.calibration.table import CAP_BYTES, COLUMNS, CalibrationKind, MeasuredTable, parse_table
from profiles.fields import Field, fault
from profiles.files import printable, read_regular_file, write_atomically
from profiles.problem import Problem, ProfileError

MODULUS = Field(key="youngs_modulus_gpa", unit="GPa", above=0, at_most=1000)
"""What a table of deflections has to state before its points: Young's modulus of the bar."""

TYPED_OUT = Field(key="typed_out", above=0)
"""What a large step has to be confirmed with: its value, or its ratio."""

AGAIN = frozenset({"angle_deg", "deflection_um", "torque_n_m", "force_n"})
"""Columns that differ from point to point; the others begin with the value of the point before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """Points of one kind. `file` and `content` are those of an imported file, empty if they were entered."""

    kind: CalibrationKind
    rows: tuple[tuple[float, ...], ...] = ()
    modulus_gpa: float | None = None
    file: str = ""
    content: bytes = b""
    affine: bool = False

    @property
    def fields(self) -> tuple[Field, ...]:
        """Return what is entered for a point."""
        return COLUMNS[self.kind]

    @property
    def wants_modulus(self) -> bool:
        """Whether the modulus of the bar has to be entered first."""
        return self.kind is CalibrationKind.DEFLECTION and self.modulus_gpa is None and not self.content

    @property
    def is_empty(self) -> bool:
        """Whether nothing of it has been entered yet."""
        return not (self.rows or self.content) and self.modulus_gpa is None

    def with_row(self, row: tuple[float, ...]) -> Draft:
        """Return it with one more point; points that were imported become a table of one's own."""
        return replace(self, rows=(*self.rows, row), file="", content=b"")

    @property
    def text(self) -> bytes:
        """Return the table as a file, byte for byte the imported one where it was."""
        return self.content or "\n".join(self._lines()).encode()

    def measured_table(self) -> MeasuredTable:
        """Return the table as the command reads it. Raises ProfileError: `calibration.*`."""
        return parse_table(self.text, self.kind, where=printable(self.file))

    def _lines(self) -> Iterator[str]:
        yield "# decimal: point"
        if self.modulus_gpa is not None:
            yield f"# {MODULUS.key}: {self.modulus_gpa:.17g}"
        yield ";".join(field.key for field in self.fields)
        for row in self.rows:
            yield ";".join(f"{value:.17g}" for value in row)
        yield ""


def import_points(path: Path) -> Draft:
    """Return the points of a file. Raises ProfileError: as `read_regular_file`; `calibration.*`."""
    content = read_regular_file(path, cap_bytes=CAP_BYTES, area="calibration")
    measured = parse_table(content, where=printable(str(path)))
    columns = [measured.columns[field.key] for field in COLUMNS[measured.kind]]
    rows = tuple(tuple(float(value) for value in row) for row in zip(*columns, strict=True))
    modulus_gpa = stated_number(measured.meta, MODULUS.key)
    return Draft(kind=measured.kind, rows=rows, modulus_gpa=modulus_gpa, file=str(path), content=content)


def write_points(draft: Draft, data: Path, machine: str) -> Path:
    """Write entered points to a file of their own beside the calibrations, and return it."""
    folder = data / FOLDER / folder_name(machine)
    make_folder(folder)
    date = "".join(c for c in utc_now() if c.isalnum())
    path = folder / f"points-{draft.kind}-{date}.csv"
    write_atomically(path, draft.text, overwrite=False, private=True)
    return path


def value_of(text: str, field: Field, units: Units = METRIC) -> float:
    """Parse an entry, a length in the unit in which it is asked for, and return it in the unit of the field.

    Raises ProfileError: `value.ambiguous`; `calibration.not_number`, `.out_of_range`.
    """
    value = entered_number(stored_length(text, field.key, field.limit, field.unit, units), field)
    typed = text if units.unit(field.unit) == field.unit else f"{text} {units.unit(field.unit)}"
    if isinstance(value, str):
        raise ProfileError(_entry_problem("calibration.not_number", text, field))
    if fault(field, float(value)):
        raise ProfileError(_entry_problem("calibration.out_of_range", typed, field))
    return float(value)


def _entry_problem(code: str, text: str, field: Field) -> Problem:
    return Problem(code=code, key=field.key, value=printable(text, 30), limit=field.limit)
