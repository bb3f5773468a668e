"""Several roundness sections of one part: files of one each, or one file with a column of heights.

A table with one more column, `z_mm` ("Height [mm]", "Z / mm"), is a section for each height in it. Points x, y,
z are those of a coordinate measuring machine: the sections then stand about one axis, the middle of their
circles, with deviations from their mean radius. A file of one section states its height as `# z_mm: 22.5`.

Where the heights of a table are not few with a profile each, its points were extracted in another way
(ISO 12180-2): bird-cage (generatrices at few angles), a helix, or points. They have a form, but no sections.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from profiles.arrays import Floats, read_only
from profiles.files import printable
from profiles.metrology.geometric import polar
from profiles.metrology.points import HANDFUL
from profiles.problem import Problem, ProfileError, refusal_error
from profiles.trace_files.header import NUMBERS_READ
from profiles.trace_files.limits import decode_trace_text, lines_of, too_large
from profiles.trace_files.number_marks import NumberMarks
from profiles.trace_files.table import (
    FEWEST_POINTS,
    PLAIN_HEADER,
    PROBLEM_CAP,
    ColumnFormat,
    TraceTableReader,
    column_name,
)
from profiles.traces import OF_BYTES, OF_TEXT, Trace, parse_trace, read_trace_file, trace_of_table

MOST_SECTIONS = 100
LARGEST_MM = 10_000.0
HEIGHT = "z_mm"
INDEX = "index"  # header line: what makes angle 0 the same for all sections
BIRD_CAGE, HELIX, POINTS = "bird-cage", "helix", "points"
NO_SECTIONS = {BIRD_CAGE: "trace.bird_cage", HELIX: "trace.helix", POINTS: "trace.scattered"}
SECTIONS = "sections"  # roundness profiles
JITTER_MM = 0.05  # within which points are of one section (choice)
GENERATRIX_DEG = 0.1  # within which points are of one generatrix (choice)
LEAST_ON_LINE = 8  # points on each generatrix of a bird-cage: as many show one wave along it
_AGAIN = ("trace.duplicate_angle", "trace.duplicate_point")
_COMMON = ("state", "direction", "start_mark", "jaw_1_deg", "z_from", "filter_upr", "method", "size", "radius_mm")
Lines = list[tuple[int, str]]
"""Lines of a file with their numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TraceSection:
    """One section of a part; `z_mm` is its height in the coordinate of the file, None where it is not stated."""

    z_mm: float | None
    trace: Trace


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfacePoints:
    """M points of a surface that are no sections: angles (deg, of one turn), heights (mm), deviations (um).

    `strategy` is "bird-cage", "helix" or "points"; `meta` as of a `Trace`.
    """

    strategy: str
    angle_deg: Floats
    z_mm: Floats
    deviation_um: Floats
    meta: Mapping[str, str]


def read_surface(paths: Sequence[Path]) -> tuple[TraceSection, ...] | SurfacePoints:
    """Return the sections of all files, as `read_sections`, or the points of the only file."""
    if len(paths) == 1:
        return parse_surface(read_trace_file(paths[0]), where=printable(str(paths[0])))
    return read_sections(paths)


def read_sections(paths: Sequence[Path]) -> tuple[TraceSection, ...]:
    """Return the sections of all files, from the lowest height up.

    Raises `ProfileError`: as `parse_sections`; `trace.no_height`, one of several does not state its height;
    `trace.duplicate_height`, two have the same; `trace.sections_differ`, they do not state the same of a
    measurement, so that they have no common index, side or size.
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
        if (before := where_of.get(section.z_mm)) is not None:
            raise refusal_error("trace.duplicate_height", where=where, value=f"{section.z_mm:g} mm", limit=before)
        where_of[section.z_mm] = where
        _refuse_differing(section.trace, found[0][0].trace, where)
    sections = [section for section, _ in found]
    if len(paths) > 1 and all(each.trace.centre_mm is not None for each in sections):
        sections = list(_about_one_axis(sections))
    return tuple(sorted(sections, key=lambda each: each.z_mm or 0.0))


def _refuse_differing(trace: Trace, first: Trace, where: str) -> None:
    for key in _COMMON if first.centre_mm is None else _COMMON[:-1]:
        value, before = trace.meta.get(key), first.meta.get(key)
        if value != before:
            value, limit = f"{key}: {value or '-'}", f"{key}: {before or '-'}"
            raise refusal_error("trace.sections_differ", where=where, key=key, value=value, limit=limit)


def parse_sections(content: bytes, *, where: str = "") -> tuple[TraceSection, ...]:
    """Return the sections in the bytes of a file, from the lowest height up.

    Raises `ProfileError`: as `profiles.traces.parse_trace`; `trace.helix`, `trace.bird_cage` or
    `trace.scattered`, its points are no sections.
    """
    found = parse_surface(content, where=where)
    if isinstance(found, SurfacePoints):
        raise ProfileError(no_sections(found, where))
    return found


def no_sections(points: SurfacePoints, where: str) -> Problem:
    """Return that the roundness of a section is not to be had from such points."""
    return Problem(code=NO_SECTIONS[points.strategy], where=where, value=str(points.z_mm.size))


def sections_content(sections: Sequence[TraceSection]) -> bytes:
    """Return the bytes of one file of several sections, which reads as these; they state the same header."""
    meta = {key: value for key, value in sections[0].trace.meta.items() if key not in (HEIGHT, NUMBERS_READ)}
    lines = [*(f"# {key}: {value}" for key, value in meta.items()), f"{HEIGHT},{PLAIN_HEADER}"]
    for each in sections:
        pairs = zip(each.trace.angle_deg.tolist(), each.trace.deviation_um.tolist(), strict=True)
        lines.extend(f"{each.z_mm!r},{angle!r},{deviation!r}" for angle, deviation in pairs)
    return ("\n".join(lines) + "\n").encode()


def parse_surface(content: bytes, *, where: str = "") -> tuple[TraceSection, ...] | SurfacePoints:
    """Return the sections in the bytes of a file, from the lowest height up, or its points if it has none.

    Raises `ProfileError`: as `parse_sections` does for what is no table of sections; `trace.height_unit`.
    """
    if not any(each.begins(content) for each in OF_BYTES):
        text = decode_trace_text(content, where)
        if not any(each.begins(text) for each in OF_TEXT):
            lines = [(number, line.strip(" \t")) for number, line in enumerate(lines_of(text, where), start=1)]
            header = next((line for _, line in lines if line and not line.startswith("#")), "")
            names = [column_name(cell) for cell in ColumnFormat(header).cells(ColumnFormat(header).header)]
            if HEIGHT in names and len(names) > 1:
                return _split(lines, names.index(HEIGHT), header, text, where)
            for name in names:
                if name.startswith("z_") and len(names) > 1:
                    raise refusal_error("trace.height_unit", where=where, value=name, limit=HEIGHT)
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


def _split(
    lines: Lines, column: int, header: str, text: str, where: str
) -> tuple[TraceSection, ...] | SurfacePoints:
    """Return the sections of a table with a column of heights: each height is read as a table without it."""
    columns = ColumnFormat(header)
    names = columns.cells(columns.header)
    del names[column]
    first = next(at for at, (_, line) in enumerate(lines) if line == header)
    above = [*lines[:first], (lines[first][0], columns.separator.join(names))]
    heights = _by_height(lines[first + 1 :], column, columns, text, where)
    levels = _levels(heights)
    if levels is None:
        return _points(above, heights, text, where)
    if len(levels) > MOST_SECTIONS:
        raise too_large(where, f"{len(levels)} heights", f"{MOST_SECTIONS} heights")
    found, twice = list[TraceSection](), list[Problem]()
    for z_mm, points in sorted(levels.items()):
        if len(points) < FEWEST_POINTS:
            at, value, limit = f"{where}:{points[0][0]}", str(len(points)), f">= {FEWEST_POINTS}"
            raise refusal_error("trace.few_at_height", where=at, key=f"Z {z_mm:g} mm", value=value, limit=limit)
        reader = TraceTableReader(where, text)
        for number, line in (*above, *points):
            if line:
                reader.take(number, line)
        again = [each for each in reader.problems if each.code in _AGAIN]
        if len(again) == len(reader.problems) >= FEWEST_POINTS:  # a whole section, not a slip
            key, value = f"Z {z_mm:g} mm", str(len(again))
            twice.append(replace(again[0], code="trace.height_twice", key=key, value=value))
            continue
        reader.finish()
        found.append(TraceSection(z_mm=z_mm, trace=trace_of_table(reader)))
    if twice:
        raise ProfileError(*twice)
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
    if problems:
        raise ProfileError(*problems)
    return found


def _levels(heights: Mapping[float, Lines]) -> dict[float, Lines] | None:
    """Return the points of each section; None where most heights have too few for a profile.

    A measuring machine does not come to the same height for each point of a section: those within `JITTER_MM` are
    one, at their mean.
    """
    levels = dict(heights)
    if _are_sections(levels):
        return levels
    levels, begun = {}, []
    ordered = sorted(heights)
    for place, z_mm in enumerate(ordered):
        begun.append(z_mm)
        last = place + 1 == len(ordered)
        if last or ordered[place + 1] - begun[0] > JITTER_MM:
            if not last and ordered[place + 1] - z_mm < JITTER_MM:
                return None  # heights that go on without a step
            points = sorted(line for each in begun for line in heights[each])
            levels[round(float(np.mean(begun)), 4)] = points
            begun = []
    return levels if _are_sections(levels) else None


def _are_sections(levels: Mapping[float, Lines]) -> bool:
    """Whether there is a profile at each height: more heights than angles are the lines of a bird-cage."""
    each, count = float(np.median([len(points) for points in levels.values()])), len(levels)
    return each >= FEWEST_POINTS and (count <= each or (each >= HANDFUL and count <= MOST_SECTIONS))


def _points(above: Lines, heights: Mapping[float, Lines], text: str, where: str) -> SurfacePoints:
    """Return the points of a table whose heights are no sections, in the order of the file."""
    rows = sorted((number, line, z_mm) for z_mm, lines in heights.items() for number, line in lines)
    reader = TraceTableReader(where, text, scattered=True)
    for number, line in (*above, *((number, line) for number, line, _ in rows)):
        if line:
            reader.take(number, line)
    reader.finish()
    trace, z_mm = trace_of_table(reader), np.array([z for *_, z in rows])
    return SurfacePoints(
        strategy=_strategy(trace.angle_deg, z_mm),
        angle_deg=read_only(np.mod(trace.angle_deg, 360.0)),
        z_mm=read_only(z_mm),
        deviation_um=trace.deviation_um,
        meta=trace.meta,
    )


def _strategy(angle_deg: Floats, z_mm: Floats) -> str:
    """Return the extraction strategy of points in the order of their file, as ISO 12180-2 names it."""
    turned, along = np.diff(np.unwrap(angle_deg, period=360.0)), np.diff(z_mm)
    one_way = all((np.all(each > 0.0) or np.all(each < 0.0)) for each in (turned, along))
    if one_way and abs(turned.sum()) >= 360.0:
        return HELIX
    return BIRD_CAGE if np.unique(generatrix_of(angle_deg)).size * LEAST_ON_LINE <= z_mm.size else POINTS


def generatrix_of(angle_deg: Floats) -> Floats:
    """Return the angle of the generatrix that each point of a bird-cage is on, in whole steps of it."""
    return np.mod(np.round(np.mod(angle_deg, 360.0) / GENERATRIX_DEG), round(360.0 / GENERATRIX_DEG))


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
            meta=MappingProxyType({**section.trace.meta, "radius_mm": repr(radius_mm), INDEX: "coordinates"}),
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
