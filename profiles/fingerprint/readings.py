"""Readings of an indicator on a clamped part, finger-tight and at full force; their file, read strictly.

The file is text: lines `# key: value`, a line that names the columns, then one row for each place. The same place
may be read several times, as from both directions of rotation.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from profiles.files import printable, read_regular_file
from profiles.problem import Problem, ProfileError
from profiles.trace_files.limits import text_of

SCHEMA = "1"
COLUMNS = ("angle_deg", "finger_tight_um", "full_force_um")
INDEX, JAW_1 = "spindle index", "jaw 1"
LEAST_PLACES, MOST_ROWS = 6, 720
MOST_UM = 5000.0
MOST_FORCE_N, MOST_GRADUATION_UM = 1e6, 100.0
CAP_BYTES = 200_000

_CHOICES = {
    "fingerprint": (SCHEMA,),
    "units": ("um",),
    "angle_zero": (INDEX, JAW_1),
    "direction": ("spindle", "against"),
    "positive": ("outward", "inward"),
}
_NUMBERS = {"graduation_um": MOST_GRADUATION_UM, "finger_force_n": MOST_FORCE_N}
_OWN = ("simulated", "note")  # what a simulated lathe, and whoever measured, writes beside them
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)", re.ASCII)
_PROBLEM_CAP = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampReadings:
    """Readings at K places: spindle angles or angles from jaw 1, deg; both readings in um, as on the dial.

    `from_jaw_1`: the angles count from jaw 1 instead of the spindle index; `against` the direction of the spindle.
    `inward`: the dial rises as the surface goes in. `graduation_um` is that of the dial, None where not stated;
    `finger_force_n` the force of finger-tight, None where nobody knows it.
    """

    angle_deg: tuple[float, ...]
    finger_um: tuple[float, ...]
    full_um: tuple[float, ...]
    from_jaw_1: bool = False
    against: bool = False
    inward: bool = False
    graduation_um: float | None = None
    finger_force_n: float | None = None
    simulated: bool = False

    @property
    def places(self) -> int:
        """The number of different angles."""
        return len({round(angle % 360.0, 6) for angle in self.angle_deg})


def readings_problem(readings: ClampReadings) -> Problem | None:
    """Return why these are too few readings, None where they are not."""
    if readings.places >= LEAST_PLACES:
        return None
    return Problem(code="clamping.few_places", value=str(readings.places), limit=f">= {LEAST_PLACES}")


def read_readings(path: Path) -> ClampReadings:
    """Read a file of readings. Raises `ProfileError`: every problem of it, each with line and column."""
    content = read_regular_file(path, cap_bytes=CAP_BYTES, area="clamping")
    return parse_readings(content, printable(str(path)))


def parse_readings(content: bytes, where: str = "") -> ClampReadings:
    """Parse the bytes of a file; `where` names it in the problems."""
    text = text_of(content, where, "clamping.not_text").replace("\r\n", "\n").replace("\r", "\n")
    reader = _ReadingsReader(where)
    for number, line in enumerate(text.split("\n"), start=1):
        if line.strip():
            reader.take(number, line)
        if len(reader.problems) >= _PROBLEM_CAP:
            break
    return reader.to_readings()


def readings_text(readings: ClampReadings) -> str:
    """Return readings as the text of a file."""
    meta = {
        "fingerprint": SCHEMA,
        "units": "um",
        "angle_zero": JAW_1 if readings.from_jaw_1 else INDEX,
        "direction": "against" if readings.against else "spindle",
        "positive": "inward" if readings.inward else "outward",
    }
    for key in _NUMBERS:
        value = getattr(readings, key)
        meta |= {} if value is None else {key: _format_number(value)}
    meta |= {"simulated": "yes"} if readings.simulated else {}
    rows = zip(readings.angle_deg, readings.finger_um, readings.full_um, strict=True)
    lines = [f"# {key}: {value}" for key, value in meta.items()]
    lines += [",".join(COLUMNS), *(",".join(_format_number(cell) for cell in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _format_number(value: float) -> str:
    """Return a number as a file has it: six decimals at most, and no exponent."""
    return f"{round(value, 6) + 0.0:.6f}".rstrip("0").rstrip(".")


class _ReadingsReader:
    """Reads the lines of one file in turn, and collects what is wrong in them."""

    def __init__(self, where: str) -> None:
        self.problems: list[Problem] = []
        self._where = where
        self._meta: dict[str, str] = {}
        self._said: set[str] = set()
        self._rows: list[tuple[float, float, float]] = []
        self._header = 0

    def take(self, number: int, line: str) -> None:
        if line.lstrip().startswith("#"):
            self._take_meta(number, line)
        elif not self._header:
            self._header = number
            if tuple(cell.strip() for cell in line.split(",")) != COLUMNS:
                self._refuse(
                    "clamping.columns", number, 1, value=printable(line.strip(), 60), limit=",".join(COLUMNS)
                )
        else:
            self._take_row(number, line)

    def to_readings(self) -> ClampReadings:
        missing = [key for key in _CHOICES if key not in self._meta and key not in self._said]
        if missing:
            limit = "; ".join(f"# {key}: {' | '.join(_CHOICES[key])}" for key in missing)
            self.problems.insert(0, Problem(code="clamping.missing", where=self._where, limit=limit))
        if not self._header:
            self.problems.append(
                Problem(code="clamping.columns", where=self._where, value="-", limit=",".join(COLUMNS))
            )
        columns: Sequence[tuple[float, ...]] = list(zip(*self._rows, strict=True)) or [()] * len(COLUMNS)
        found = ClampReadings(
            angle_deg=columns[0],
            finger_um=columns[1],
            full_um=columns[2],
            from_jaw_1=self._meta.get("angle_zero") == JAW_1,
            against=self._meta.get("direction") == "against",
            inward=self._meta.get("positive") == "inward",
            graduation_um=self._number("graduation_um"),
            finger_force_n=self._number("finger_force_n"),
            simulated=self._meta.get("simulated") == "yes",
        )
        few = readings_problem(found)
        if few is not None and not self.problems:
            self.problems.append(Problem(code=few.code, where=self._where, value=few.value, limit=few.limit))
        if self.problems:
            raise ProfileError(*self.problems)
        return found

    def _number(self, key: str) -> float | None:
        return float(self._meta[key]) if key in self._meta else None

    def _take_meta(self, number: int, line: str) -> None:
        start = line.index("#") + 1
        key, colon, value = (part.strip() for part in line[start:].partition(":"))
        column = 1 + line.index(key, start) if key else start
        if not colon or self._header or key in self._said:
            self._refuse("clamping.meta", number, column, value=printable(line.strip(), 60), limit="# key: value")
            return
        self._said.add(key)
        known = (*_CHOICES, *_NUMBERS, *_OWN)
        column_of_value = 1 + line.index(":", start) + 1 + (1 if value else 0)
        if key not in known:
            self._refuse("clamping.unknown_key", number, column, key=printable(key, 40), limit=", ".join(known))
        elif key in _CHOICES and value not in _CHOICES[key]:
            code = "clamping.schema" if key == "fingerprint" else "clamping.value"
            limit = " | ".join(_CHOICES[key])
            self._refuse(code, number, column_of_value, key=key, value=printable(value, 40), limit=limit)
        elif key in _NUMBERS and not (_NUMBER.fullmatch(value) and 0.0 < float(value) <= _NUMBERS[key]):
            limit = f"> 0, <= {_NUMBERS[key]:g}"
            self._refuse(
                "clamping.value", number, column_of_value, key=key, value=printable(value, 40), limit=limit
            )
        else:
            self._meta[key] = value

    def _take_row(self, number: int, line: str) -> None:
        cells = line.split(",")
        if len(cells) != len(COLUMNS):
            column = 1 + len(",".join(cells[: len(COLUMNS)])) if len(cells) > len(COLUMNS) else len(line) + 1
            self._refuse("clamping.cells", number, column, value=str(len(cells)), limit=",".join(COLUMNS))
            return
        if len(self._rows) >= MOST_ROWS:
            self._refuse("clamping.too_many", number, 1, limit=str(MOST_ROWS))
            return
        values, column = [], 1
        for key, cell in zip(COLUMNS, cells, strict=True):
            low, high = (0.0, 360.0) if key == "angle_deg" else (-MOST_UM, MOST_UM)
            plain = cell.strip()
            value = float(plain) if _NUMBER.fullmatch(plain) else math.nan
            if not low <= value <= high or (key == "angle_deg" and value == high):
                limit = "0 <= angle_deg < 360" if key == "angle_deg" else f"{low:g} - {high:g} um"
                at = column + len(cell) - len(cell.lstrip())
                self._refuse("clamping.cell", number, at, key=key, value=printable(plain, 40), limit=limit)
            values.append(value)
            column += len(cell) + 1
        self._rows.append((values[0], values[1], values[2]))

    def _refuse(self, code: str, number: int, column: int, **facts: str) -> None:
        where = f"{self._where}:{number}:{column}"
        self.problems.append(Problem(code=code, where=where, **facts))
