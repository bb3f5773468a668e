"""Profiles in text records: SMD files (ISO 5436-2) and the PRF files of the NPL's softgauges.

Both begin with a record that names the file, its feature (`PRF`, a profile) and its axes, one a line: name, type,
number of points, unit, scale, type of the numbers; the heights follow, a value times the scale is in that unit.

An SMD file separates its fields with NUL and blanks and its records with ETX, and its X axis is incremental
(`I`) with the step at the end of its line. Its checksum is not compared: writers use another modulus. A PRF
file separates its records with `EOR`; its axes are measured (`M`), and its second record maps the numbers, here
only as in the published example. The unit of its `SPACING` is uncertain, so no radius follows from it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from profiles.trace_files.closed import (
    ABOVE_ZERO,
    UM_PER_M,
    ClosedProfile,
    TraceFormat,
    closed,
    heights_um,
    number,
    point_count,
    unusable,
)
from profiles.trace_files.limits import lines_of, words_of

_SMD = re.compile(r"\s*ISO ?5436")
_PRF = re.compile(r"\s*1[ \t]+2[ \t]*\n[^\n]*\bPRF\b")

_UM_PER_UNIT: Mapping[str, float] = {"m": 1e6, "mm": 1e3, "um": 1.0, "nm": 1e-3}
_MAPS = {("1", "CZ", "CZ", "1", "1"), ("2", "CZ", "CX", "1", "0")}

_Lines = list[tuple[str, str]]
"""Lines with their positions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Axis:
    kind: str
    points: float
    um_per_number: float
    further: Sequence[str]


def read_smd(text: str, where: str) -> ClosedProfile:
    """Return the profile in the text of an SMD file. Raises as `profiles.trace_files.sdf.read_sdf`."""
    head, _, heights = _records(text, "\x03", where)
    _feature(head, where)
    x, z = _axis("CX", head, where), _axis("CZ", head, where)
    for name, axis, target in (("CX", x, "I"), ("CZ", z, "A")):
        if axis.kind != target:
            raise unusable(where, name, axis.kind, target)
    step = number(x.further[0] if x.further else "", "CX", where, ABOVE_ZERO, 1e6)
    step_m = step * x.um_per_number / UM_PER_M
    return closed("SMD", _heights(heights, z), z.points, step_m, where)


def read_prf(text: str, where: str) -> ClosedProfile:
    """Return the profile in the text of a PRF file. Raises as `profiles.trace_files.sdf.read_sdf`."""
    head, told, heights = _records(text, "EOR", where)
    _feature(head, where)
    x, z = _axis("CX", head, where), _axis("CZ", head, where)
    for name, axis in (("CX", x), ("CZ", z)):
        if axis.kind != "M":
            raise unusable(where, name, axis.kind, "M")
    for place, line in told:
        words = line.split()
        if words[0] == "MAP" and tuple(_plain(word) for word in words[1:]) not in _MAPS:
            raise unusable(place, "MAP", line, "MAP 1 CZ CZ 1 1, MAP 2 CZ CX 1 0")
    return closed("PRF", _heights(heights, z), z.points, 0.0, where)


def _records(text: str, end: str, where: str) -> tuple[_Lines, _Lines, _Lines]:
    """Return the lines of the first three records; checksums and remarks follow."""
    records: list[_Lines] = [[]]
    for place, line in enumerate(lines_of(text.replace("\0", " "), where), start=1):
        plain = line.strip(" \t\x1a")
        if plain == end:
            records.append([])
        elif plain:
            records[-1].append((f"{where}:{place}", plain))
    if len(records) < 4:
        raise unusable(where, "records", str(len(records) - 1), ">= 3")
    return records[0], records[1], records[2]


def _feature(head: _Lines, where: str) -> None:
    """Refuse anything but a profile."""
    line = head[1][1] if len(head) > 1 else ""
    if "PRF" not in line.split():
        raise unusable(where, "feature", line, "PRF")


def _axis(name: str, head: _Lines, where: str) -> _Axis:
    for place, line in head[2:]:
        words = line.split()
        if words[0] != name:
            continue
        kind, points, unit, scale, _, *further = (*words[1:], *[""] * (6 - len(words)))
        plain = unit.lower().replace("µ", "u").replace("μ", "u")
        if plain not in _UM_PER_UNIT:
            raise unusable(place, name, line, ", ".join(_UM_PER_UNIT))
        factor = number(scale, name, place, ABOVE_ZERO, 1e6)
        count = point_count(points, name, place)
        return _Axis(kind=kind, points=count, um_per_number=factor * _UM_PER_UNIT[plain], further=further)
    raise unusable(where, name, "", "CX, CZ")


def _heights(lines: _Lines, axis: _Axis) -> list[float]:
    cells = ((place, cell) for place, line in lines for cell in words_of(line))
    return heights_um(cells, axis.um_per_number, axis.points)


def _plain(word: str) -> str:
    """Return a number in its shortest form, a word as it is."""
    try:
        return f"{float(word):g}"
    except ValueError:
        return word


SMD = TraceFormat(name="SMD", standard="ISO 5436-2", begins=_SMD.match, read=read_smd)
PRF = TraceFormat(name="PRF", standard="softgauges of the NPL", begins=_PRF.match, read=read_prf)
