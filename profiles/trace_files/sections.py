"""Several roundness sections of one part: files of one each, or one file with a column of heights.

A table with one more column, `z_mm` ("Height [mm]", "Z / mm"), is a section for each height in it. Points x, y,
z are those of a coordinate measuring machine: the sections then stand about one axis, the middle of their
circles, with deviations from their mean radius. A file of one section states its height as `# z_mm: 22.5`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from profiles.arrays import Floats, read_only
from profiles.files import printable
from profiles.metrology.geometric import polar
from profiles.problem import Problem, ProfileError, refusal_error
from profiles.trace_files.limits import decode_trace_text, lines_of, too_large
from profiles.trace_files.number_marks import NumberMarks
from profiles.trace_files.table import PROBLEM_CAP, ColumnFormat, TraceTableReader, column_name
from profiles.traces import OF_BYTES, OF_TEXT, Trace, parse_trace, read_trace_file, trace_of_table

MOST_SECTIONS = 100
LARGEST_MM = 10_000.0
HEIGHT = "z_mm"
Lines = list[tuple[int, str]]
"""Lines of a file with their numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TraceSection:
    """One section of a part; `z_mm` is its height in the coordinate of the file, None where it is not stated."""

    z_mm: float | None
    trace: Trace


def read_sections(paths: Sequence[Path]) -> tuple[TraceSection, ...]:
    """Return the sections of all files, from the lowest height up.

    Raises `ProfileError`: as `profiles.traces.parse_trace`; `trace.no_height`, one of several does not state its
    height; `trace.duplicate_height`, two have the same.
    """
    found = [
        (section, printable(str(path)))
        for path in paths
        for section in parse_sections(read_trace_file(path), where=printable(str(path)))
    ]
    where_of: dict[float, str] = {}
    for section, where in found if len(found) > 1 else ():
        if section.z_mm is None:
            raise refusal_error("trace.no_height", where=where, limit=f"# {HEIGHT}: Z")
        before = where_of.setdefault(section.z_mm, where)
        if before != where:
            raise refusal_error("trace.duplicate_height", where=where, value=f"{section.z_mm:g} mm", limit=before)
    return tuple(sorted((section for section, _ in found), key=lambda each: each.z_mm or 0.0))


def parse_sections(content: bytes, *, where: str = "") -> tuple[TraceSection, ...]:
    """Return the sections in the bytes of a file, in the order of their first points."""
    if not any(each.begins(content) for each in OF_BYTES):
        text = decode_trace_text(content, where)
        if not any(each.begins(text) for each in OF_TEXT):
            lines = [(number, line.strip(" \t")) for number, line in enumerate(lines_of(text, where), start=1)]
            header = next((line for _, line in lines if line and not line.startswith("#")), "")
            names = [column_name(cell) for cell in ColumnFormat(header).cells(ColumnFormat(header).header)]
            if HEIGHT in names and len(names) > 1:
                return _split(lines, names.index(HEIGHT), header, text, where)
    trace = parse_trace(content, where=where)
    return (TraceSection(z_mm=_stated_mm(trace, where), trace=trace),)


def _stated_mm(trace: Trace, where: str) -> float | None:
    if HEIGHT not in trace.meta:
        return None
    value, code = NumberMarks(",", None, str).read(trace.meta[HEIGHT])
    if code or abs(value) > LARGEST_MM:
        raise refusal_error(
            "trace.key", where=where, key=HEIGHT, value=trace.meta[HEIGHT], limit=f"<= {LARGEST_MM:g} mm"
        )
    return value


def _split(lines: Lines, column: int, header: str, text: str, where: str) -> tuple[TraceSection, ...]:
    """Return the sections of a table with a column of heights: each height is read as a table without it."""
    columns = ColumnFormat(header)
    names = columns.cells(columns.header)
    del names[column]
    first = next(at for at, (_, line) in enumerate(lines) if line == header)
    above = [*lines[:first], (lines[first][0], columns.separator.join(names))]
    found = []
    for z_mm, points in _by_height(lines[first + 1 :], column, columns, text, where).items():
        reader = TraceTableReader(where, text)
        for number, line in (*above, *points):
            if line:
                reader.take(number, line)
        reader.finish()
        found.append(TraceSection(z_mm=z_mm, trace=trace_of_table(reader)))
    return _about_one_axis(found) if found and found[0].trace.centre_mm is not None else tuple(found)


def _by_height(lines: Lines, column: int, columns: ColumnFormat, text: str, where: str) -> dict[float, Lines]:
    """Return the lines of each height without its cell. Raises `ProfileError` with the lines that state none."""
    marks = NumberMarks(columns.separator, _decimal(text), lambda: text.partition(columns.header)[2])
    found: dict[float, Lines] = {}
    problems: list[Problem] = []
    for number, line in lines:
        if not line or line.startswith("#"):
            continue
        cells, shown = columns.cells(line), printable(line, 60)
        cell = cells.pop(column) if column < len(cells) else ""
        z_mm, code = marks.read(cell)
        if code or abs(z_mm) > LARGEST_MM:
            code, limit = code or "trace.out_of_range", f"<= {LARGEST_MM:g} mm"
            problems.append(Problem(code=code, where=f"{where}:{number}", key=HEIGHT, value=shown, limit=limit))
            if len(problems) >= PROBLEM_CAP:
                break
            continue
        quoted = (f'"{each}"' if columns.separator in each else each for each in cells)
        found.setdefault(z_mm, []).append((number, columns.separator.join(quoted)))
        if len(found) > MOST_SECTIONS:
            raise too_large(f"{where}:{number}", f"> {MOST_SECTIONS} heights", f"{MOST_SECTIONS} heights")
    if problems:
        raise ProfileError(*problems)
    return found


def _decimal(text: str) -> str | None:
    stated = (line[1:].partition(":") for line in text.split("\n") if line.startswith("#"))
    return next((value.strip() for key, _, value in stated if key.strip() == "decimal"), None)


def _about_one_axis(sections: list[TraceSection]) -> tuple[TraceSection, ...]:
    """Return sections of points in planes about the mean of their centres, with deviations from one radius."""
    centres = np.array([section.trace.centre_mm for section in sections])
    x_mm, y_mm = centres.mean(axis=0).tolist()
    radius_mm = float(np.mean([float(section.trace.meta["radius_mm"]) for section in sections]))
    turned = []
    for section in sections:
        angle, deviation = _seen(section.trace, (x_mm, y_mm), radius_mm)
        trace = replace(
            section.trace,
            angle_deg=read_only(angle),
            deviation_um=read_only(deviation),
            centre_mm=(x_mm, y_mm),
            meta=MappingProxyType({**section.trace.meta, "radius_mm": repr(radius_mm)}),
        )
        turned.append(TraceSection(z_mm=section.z_mm, trace=trace))
    return tuple(turned)


def _seen(trace: Trace, axis_mm: tuple[float, float], radius_mm: float) -> tuple[Floats, Floats]:
    assert trace.centre_mm is not None
    own_um = 1000.0 * float(trace.meta["radius_mm"]) + trace.deviation_um
    theta = np.radians(trace.angle_deg)
    x_um = own_um * np.cos(theta) + 1000.0 * (trace.centre_mm[0] - axis_mm[0])
    y_um = own_um * np.sin(theta) + 1000.0 * (trace.centre_mm[1] - axis_mm[1])
    angle, distance = polar(x_um, y_um, (0.0, 0.0))
    return angle, distance - 1000.0 * radius_mm
