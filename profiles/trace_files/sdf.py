"""Surface data files (ISO 25178-71) with one profile: one closed turn at equal angles.

The file is ASCII: a version line (`aBCR-1.0`, `aISO-1.0`), lines `Name = value`, a line `*`, the values, a line
`*`. A value times `Zscale` is a height in m. `NumPoints` times `Xscale` (m) is taken as the circumference, because
the format has no word for closed profiles, start marks or directions; so the phase stays unknown, and so does the
size. A line that starts with `;` is a remark.

Problem code: `trace.sdf`, and those of the points.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from profiles.files import printable
from profiles.problem import Problem, ProfileError
from profiles.trace_files.dialect import Dialect
from profiles.trace_files.table import FEWEST_POINTS, LARGEST_DEVIATION_UM

VERSION = re.compile(rb"\s*[abAB](BCR|ISO)-\d")
_UM_PER_M = 1e6
_MOST_POINTS = 10_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SdfProfile:
    """Deviations in um at equal angles, and the radius in mm that the spacing implies (None without a spacing)."""

    deviation_um: list[float]
    radius_mm: float | None


def read_sdf(text: str, where: str) -> SdfProfile:
    """Return the profile in the text of a surface data file.

    Raises:
        ProfileError: `trace.sdf`, a field is missing or cannot be used, or the number of values is another;
            `trace.not_number`, `trace.not_finite` (a value marked BAD, too) and `trace.out_of_range` with their
            line.
    """
    lines = [line.strip() for line in text.split("\n")]
    if not lines[0].startswith(("a", "A")):
        raise _unusable(where, "version", lines[0], "aBCR-1.0, aISO-1.0")
    body = next((n for n, line in enumerate(lines) if line.startswith("*")), len(lines))
    fields = {}
    for line in lines[1:body]:
        key, equals, value = line.partition("=")
        if equals and not line.startswith(";"):
            fields[key.strip().lower()] = value.strip()
    points = _number(fields, "NumPoints", where, FEWEST_POINTS, _MOST_POINTS)
    _number(fields, "NumProfiles", where, 1, 1)
    scale = _number(fields, "Zscale", where, math.ulp(0.0), 1.0)
    spacing_m = _number(fields, "Xscale", where, 0.0, 1.0)
    deviations = _values(lines, body + 1, scale * _UM_PER_M, where)
    if len(deviations) != points:
        raise _unusable(where, "NumPoints", f"{len(deviations)}", f"{points:g}")
    radius_mm = 1000.0 * points * spacing_m / (2.0 * math.pi)
    return SdfProfile(deviation_um=deviations, radius_mm=radius_mm or None)


def _number(fields: dict[str, str], key: str, where: str, least: float, most: float) -> float:
    stated = fields.get(key.lower(), "")
    value, code = Dialect(",").number(stated)
    if code or not least <= value <= most:
        raise _unusable(where, key, stated or "-", f"{least:g} - {most:g}")
    return value


def _values(lines: list[str], start: int, um_per_unit: float, where: str) -> list[float]:
    dialect, found = Dialect(","), []
    for number, line in enumerate(lines[start:], start=start + 1):
        if line.startswith("*"):
            break
        for cell in () if line.startswith(";") else line.split():
            value, code = dialect.number(cell)
            value_um = value * um_per_unit
            if code or abs(value_um) > LARGEST_DEVIATION_UM:
                limit = f"<= {LARGEST_DEVIATION_UM:g} um"
                code, place, shown = code or "trace.out_of_range", f"{where}:{number}", printable(cell, 60)
                raise ProfileError(Problem(code=code, where=place, key="Z", value=shown, limit=limit))
            found.append(value_um)
    return found


def _unusable(where: str, key: str, value: str, limit: str) -> ProfileError:
    return ProfileError(Problem(code="trace.sdf", where=where, key=key, value=printable(value, 60), limit=limit))
