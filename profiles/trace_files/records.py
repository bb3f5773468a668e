"""Profiles in text: SDF files (ISO 25178-71), SMD files (ISO 5436-2) and the PRF files of the NPL's softgauges.

An SDF file is a version line (`aBCR-1.0`, `aISO-1.0`, `aNPL-V1.0`), lines `Name = value`, a line `*`, the values,
a line `*`. A value times `Zscale` is a height in m, `Xscale` the step in m. A line that starts with `;` is a
remark. Binary files begin with a `b` and are refused.

The other two begin with a record that names the file, its feature (`PRF`, a profile) and its axes, one a line:
name, type, number of points, unit, scale, type of the numbers; the heights follow, a value times the scale is in
that unit. An SMD file separates its fields with NUL and blanks and its records with ETX, and its X axis is
incremental (`I`) with the step at the end of its line. Its checksum is not compared: writers use another modulus.
A PRF file separates its records with `EOR`; its axes are measured (`M`), and its second record maps the numbers,
here only as in the published example. The unit of its `SPACING` is uncertain, so no radius follows from it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from profiles.trace_files.closed_profile import (
    ABOVE_ZERO,
    UM_PER_M,
    ClosedProfile,
    TraceFormat,
    close_profile,
    heights_um,
    number,
    point_count,
    unusable,
)
from profiles.trace_files.limits import lines_of, words_of

_VERSION = re.compile(r"\s*[aAbB](BCR|ISO|NPL) ?- ?V?\d")
_SMD = re.compile(r"\s*ISO ?5436")
_PRF = re.compile(r"\s*1[ \t]+2[ \t]*\n[^\n]*\bPRF\b")

_UM_PER_UNIT: Mapping[str, float] = {"m": 1e6, "mm": 1e3, "um": 1.0, "nm": 1e-3}
_MAPS = {("1", "CZ", "CZ", "1", "1"), ("2", "CZ", "CX", "1", "0")}

_Lines = list[tuple[str, str]]
"""Lines with their positions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _RecordAxis:
    kind: str
    points: float
    um_per_number: float
    further: Sequence[str]


def read_sdf(text: str, where: str) -> ClosedProfile:
    """Return the profile in the text of a surface data file."""
    lines = [line.strip() for line in lines_of(text, where)]
    first = next(n for n, line in enumerate(lines) if line)
    if not lines[first].startswith(("a", "A")):
        raise unusable(where, "SDF: version", lines[first], "aBCR-1.0, aISO-1.0")
    body = next((n for n, line in enumerate(lines) if line.startswith("*")), len(lines))
    fields = {}
    for line in lines[first + 1 : body]:
        key, equals, value = line.partition("=")
        if equals and not line.startswith(";"):
            fields[key.strip().lower()] = value.strip()

    def stated(key: str, least: float, most: float) -> float:
        return number(fields.get(key.lower(), ""), key, where, least, most)

    points = point_count(fields.get("numpoints", ""), "NumPoints", where)
    stated("NumProfiles", 1, 1)
    um_per_unit = stated("Zscale", ABOVE_ZERO, 1.0) * UM_PER_M
    step_m = stated("Xscale", 0.0, 1.0)
    end = next((n for n in range(body + 1, len(lines)) if lines[n].startswith("*")), len(lines))
    rows = ((f"{where}:{n + 1}", lines[n]) for n in range(body + 1, end) if not lines[n].startswith(";"))
    return close_profile("SDF", heights_um(_cells(rows), um_per_unit, points), points, step_m, where)


def read_smd(text: str, where: str) -> ClosedProfile:
    """Return the profile in the text of an SMD file."""
    (_, _, heights), (x, z) = _split_records(text, "\x03", ("I", "A"), where)
    step = number(x.further[0] if x.further else "", "CX", where, ABOVE_ZERO, 1e6)
    step_m = step * x.um_per_number / UM_PER_M
    return close_profile("SMD", heights_um(_cells(heights), z.um_per_number, z.points), z.points, step_m, where)


def read_prf(text: str, where: str) -> ClosedProfile:
    """Return the profile in the text of a PRF file."""
    (_, maps, heights), (_, z) = _split_records(text, "EOR", ("M", "M"), where)
    for place, line in maps:
        words = line.split()
        if words[0] == "MAP" and tuple(_shortest_form(word) for word in words[1:]) not in _MAPS:
            raise unusable(place, "MAP", line, "MAP 1 CZ CZ 1 1, MAP 2 CZ CX 1 0")
    return close_profile("PRF", heights_um(_cells(heights), z.um_per_number, z.points), z.points, 0.0, where)


def _split_records(
    text: str, end: str, kinds: tuple[str, str], where: str
) -> tuple[list[_Lines], tuple[_RecordAxis, _RecordAxis]]:
    """Return the lines of the first three records, and the axes; checksums and remarks follow."""
    records: list[_Lines] = [[]]
    for place, line in enumerate(lines_of(text.replace("\0", " "), where), start=1):
        plain = line.strip(" \t\x1a")
        if plain == end:
            records.append([])
        elif plain:
            records[-1].append((f"{where}:{place}", plain))
    if len(records) < 4:
        raise unusable(where, "records", str(len(records) - 1), ">= 3")
    head = records[0]
    feature = head[1][1] if len(head) > 1 else ""
    if "PRF" not in feature.split():
        raise unusable(where, "feature", feature, "PRF")
    axes = _axis("CX", head, where), _axis("CZ", head, where)
    for name, axis, kind in zip(("CX", "CZ"), axes, kinds, strict=True):
        if axis.kind != kind:
            raise unusable(where, name, axis.kind, kind)
    return records[:3], axes


def _axis(name: str, head: _Lines, where: str) -> _RecordAxis:
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
        return _RecordAxis(kind=kind, points=count, um_per_number=factor * _UM_PER_UNIT[plain], further=further)
    raise unusable(where, name, "", "CX, CZ")


def _cells(lines: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    return ((place, cell) for place, line in lines for cell in words_of(line))


def _shortest_form(word: str) -> str:
    """Return a number in its shortest form, a word as it is."""
    try:
        return f"{float(word):g}"
    except ValueError:
        return word


SDF = TraceFormat(name="SDF", standard="ISO 25178-71", begins=_VERSION.match, read=read_sdf)
SMD = TraceFormat(name="SMD", standard="ISO 5436-2", begins=_SMD.match, read=read_smd)
PRF = TraceFormat(name="PRF", standard="softgauges of the NPL", begins=_PRF.match, read=read_prf)
