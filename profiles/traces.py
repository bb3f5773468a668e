"""Read and write roundness traces.

The plain file is UTF-8 text: lines `# key: value` in any number, the header `angle_deg,deviation_um`, and one
point a line, with angles in [0, 360) and each angle once. A last point at 360 that repeats the one at 0 closes the
turn and is left out. Blank lines, lines that start with `#` (after the first point they are remarks and no more),
spaces, quoted cells, a byte order mark, UTF-16 with one and any kind of line end are accepted. Columns may have
common names, "Angle [deg]" and "Deviation [µm]". Cells may also be separated by semicolons, tabs or blanks;
numbers may then have a decimal comma, and separated thousands, if the file leaves no doubt about them
(`profiles.trace_files.number_marks`). Deviations may be in mm or nm, angles may be left out where the header says
that they are equal, run from -180 to 180 or over several turns where it says so, and points may be x and y in the
plane, each once. Files of one profile at equal steps (`OF_BYTES`, `OF_TEXT`) are taken as a closed turn. Anything
else is refused with its line, all problems (up to a cap) at once. A fault on every line is reported once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from profiles.arrays import Floats, read_only
from profiles.files import printable, read_regular_file, write_atomically
from profiles.metrology.circles import LEAST_SQUARES
from profiles.metrology.geometric import geometric_circle, polar
from profiles.problem import refusal_error
from profiles.trace_files.closed_profile import ClosedProfile, TraceFormat
from profiles.trace_files.limits import decode_trace_text, lines_of
from profiles.trace_files.records import PRF, SDF, SMD
from profiles.trace_files.table import PLAIN_HEADER, PROBLEM_CAP, TraceTableReader
from profiles.trace_files.x3p import X3P

OF_BYTES: tuple[TraceFormat[bytes], ...] = (X3P,)
# The single-profile formats beside tables: to add one, write a reader and list it here.
OF_TEXT: tuple[TraceFormat[str], ...] = (SDF, SMD, PRF)
CAP_BYTES = 20_000_000  # forty bytes for each of the maximum number of points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """A measured profile: M spindle angles in deg and M deviations in um, positive outwards; shape (M,) each.

    `meta` holds the `# key: value` lines; for their meaning see `profiles.trace_files.header`. Its `format` is
    the name of a file of one profile that was taken as a closed turn. Angles run on over several turns where
    `turns` is above 1. Points in the plane stand about the centre of their least squares circle, `centre_mm` in x
    and y, with its radius as the meta key `radius_mm`. Both arrays are read only.
    """

    angle_deg: Floats
    deviation_um: Floats
    meta: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    centre_mm: tuple[float, float] | None = None


def read_trace(path: Path) -> Trace:
    """Read the trace in a file, or raise `ProfileError` with its problems."""
    return parse_trace(read_trace_file(path), where=printable(str(path)))


def read_trace_file(path: Path) -> bytes:
    """Return the bytes of a trace file, for `parse_trace`; ProfileError `trace.unreadable`, `trace.too_large`."""
    return read_regular_file(path, cap_bytes=CAP_BYTES, area="trace")


def parse_trace(content: bytes, *, where: str = "") -> Trace:
    """Parse the trace in the bytes of a file; `where` names them in the problems."""
    for binary in OF_BYTES:
        if binary.begins(content):
            return _from_profile(binary.read(content, where))
    text = decode_trace_text(content, where)
    for textual in OF_TEXT:
        if textual.begins(text):
            return _from_profile(textual.read(text, where))
    reader = TraceTableReader(where, text)
    for number, line_text in enumerate(lines_of(text, where), start=1):
        stripped = line_text.strip(" \t")
        if stripped:
            reader.take(number, stripped)
        if reader.spoilt or len(reader.problems) >= PROBLEM_CAP:
            break
    reader.finish()
    return trace_of_table(reader)


def write_trace(path: Path, trace: Trace, *, overwrite: bool = False, private: bool = False) -> None:
    """Write a trace so that reading it gives the same numbers, bit by bit; `private` as `written_atomically`.

    Raises `ProfileError` where the result could not be read back, and `file.exists` or `file.not_writable`.
    """
    where = printable(str(path))
    content = trace_content(trace, where)
    found = parse_trace(content, where=where).meta
    for key, value in trace.meta.items():
        if found.get(key) != value:
            shown = printable(f"# {key}: {value}", 60)
            raise refusal_error("trace.meta", where=where, value=shown, limit="# key: value")
    write_atomically(path, content, overwrite=overwrite, private=private)


def trace_content(trace: Trace, where: str = "") -> bytes:
    """Return the bytes of a trace file, with the numbers of `trace` bit by bit; ProfileError `trace.columns`."""
    if trace.angle_deg.ndim != 1 or trace.angle_deg.shape != trace.deviation_um.shape:
        value = f"{trace.angle_deg.shape} {trace.deviation_um.shape}"
        raise refusal_error("trace.columns", where=where, value=value, limit="(M,) (M,)")
    lines = [f"# {key}: {value}" for key, value in trace.meta.items()]
    lines.append(PLAIN_HEADER)
    pairs = zip(trace.angle_deg.tolist(), trace.deviation_um.tolist(), strict=True)
    lines.extend(f"{angle!r},{deviation!r}" for angle, deviation in pairs)
    # What cannot be encoded becomes a question mark, which `write_trace` refuses.
    return ("\n".join(lines) + "\n").encode("utf-8", errors="replace")


def trace_of_table(reader: TraceTableReader) -> Trace:
    """Return the trace of a table that was read to its end."""
    assert reader.columns is not None
    first, second, meta = np.array(reader.first), np.array(reader.second), dict(reader.meta)
    centre_mm = None
    if reader.columns.plane:
        circle = geometric_circle(LEAST_SQUARES, first, second)
        centre = (circle.centre_x_um, circle.centre_y_um)
        centre_mm = (centre[0] / 1000.0, centre[1] / 1000.0)
        first, distance = polar(first, second, centre)
        second = distance - circle.deviation_um
        if "radius_mm" in meta:
            value = printable(f"# radius_mm: {meta['radius_mm']}", 60)
            raise refusal_error("trace.meta", where=reader.where, value=value, limit="x_mm,y_mm")
        meta["radius_mm"] = repr(circle.deviation_um / 1000.0)
    elif len(reader.columns.names) == 1:
        first = np.arange(second.size) * (360.0 * int(meta.get("turns", "1")) / second.size)
    return Trace(
        angle_deg=read_only(first),
        deviation_um=read_only(second),
        meta=MappingProxyType(meta),
        centre_mm=centre_mm,
    )


def _from_profile(profile: ClosedProfile) -> Trace:
    size = len(profile.deviation_um)
    meta = {"format": profile.format, "size": "relative"}
    if profile.radius_mm is not None:
        meta["radius_mm"] = repr(profile.radius_mm)
    return Trace(
        angle_deg=read_only(np.arange(size) * 360.0 / size),
        deviation_um=read_only(profile.deviation_um),
        meta=MappingProxyType(meta),
    )
