"""Surface data files (SDF, ISO 25178-71) with one profile.

The file is ASCII: a version line (`aBCR-1.0`, `aISO-1.0`, `aNPL-V1.0`), lines `Name = value`, a line `*`, the
values, a line `*`. A value times `Zscale` is a height in m, `Xscale` the step in m. A line that starts with `;` is
a remark. Binary files begin with a `b` and are refused.
"""

from __future__ import annotations

import re

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

_VERSION = re.compile(r"\s*[aAbB](BCR|ISO|NPL) ?- ?V?\d")


def read_sdf(text: str, where: str) -> ClosedProfile:
    """Return the profile in the text of a surface data file.

    Raises `ProfileError`: `trace.format`, a field is missing or cannot be used, or the number of values differs;
    and what `profiles.trace_files.closed.heights_um` refuses.
    """
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
    cells = ((place, cell) for place, line in rows for cell in words_of(line))
    return closed("SDF", heights_um(cells, um_per_unit, points), points, step_m, where)


SDF = TraceFormat(name="SDF", standard="ISO 25178-71", begins=_VERSION.match, read=read_sdf)
