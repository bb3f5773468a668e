"""The meaning of the `# key: value` lines of a trace: how it was measured.

Some keys change the numbers and are applied while the file is read (`units`, `angles`, `angle_range`, `decimal`);
the rest is kept here. What a trace does not state is unknown, never assumed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from profiles.files import printable
from profiles.job import Job
from profiles.problem import Problem

DIRECTIONS = ("spindle", "cw", "ccw")
"""Direction of the angles over the part, seen from the tailstock. Those of a spindle that turns
counter-clockwise in the cut (M3), taken at the tool, run clockwise over the part: `spindle` and `cw` are the
same."""
START_MARKS = ("spindle index", "jaw 1", "unknown")  # the mark at angle 0
METHODS = ("radial", "v_block", "two_point")
SIZES = ("absolute", "relative")
NUMBERS_READ = "numbers_read"  # added by the reader: a number of the file with its reading
# Keys that are applied while the file is read and then dropped:
APPLIED = ("units", "angles", "angle_range", "decimal")


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceHeader:
    """How a trace was measured; None where it is not stated.

    `direction` is one of `DIRECTIONS`, `start_mark` one of `START_MARKS`, `jaw_1_deg` the angle of jaw 1 in the
    angles of the trace (0 where jaw 1 is the start mark). `filter_upr` is the cut-off of a filter that the
    instrument has applied, `radius_mm` the radius at which the deviation is 0. `size` "relative" means that the
    instrument does not measure size, so that the mean deviation has no meaning. `method` is how it was
    measured, one of `METHODS`. `turns` of the part follow each other.
    """

    state: str = "unknown"
    direction: str | None = None
    start_mark: str | None = None
    jaw_1_deg: float | None = None
    filter_upr: float | None = None
    radius_mm: float | None = None
    size: str | None = None
    method: str | None = None
    turns: int = 1

    @property
    def phase_known(self) -> bool:
        """Whether the angles are tied to the spindle or to jaw 1: both direction and start mark are stated."""
        marked = self.jaw_1_deg is not None or self.start_mark == "spindle index"
        return self.direction is not None and marked

    @property
    def against_spindle(self) -> bool:
        """Whether the angles run the other way round the part than those of the spindle."""
        return self.direction == "ccw"

    def radius_of(self, job: Job) -> float:
        """Return the radius of the part, mm: from the trace, else that of its job after the cut."""
        return job.finished_radius_mm if self.radius_mm is None else self.radius_mm

    def jaw_1_of(self, spindle_deg: float | None) -> float | None:
        """Return the angle of jaw 1 in the angles of the trace, None where it is unknown.

        `spindle_deg` is the spindle angle of jaw 1, None where unknown; it is used where the trace begins
        at the spindle index and does not state jaw 1 itself.
        """
        if not self.phase_known or self.jaw_1_deg is not None or spindle_deg is None:
            return self.jaw_1_deg if self.phase_known else None
        return -spindle_deg if self.against_spindle else spindle_deg


def header_of(meta: Mapping[str, str]) -> tuple[TraceHeader, tuple[Problem, ...]]:
    """Return the header of these lines, with a warning for each unusable value, then treated as not stated.

    Another warning says how numbers were read that are not written with a decimal point.
    """
    warnings: list[Problem] = []
    if NUMBERS_READ in meta:
        warnings.append(Problem(code="value.numbers_read", value=printable(meta[NUMBERS_READ], 60)))

    def number(key: str, above: float, limit: str) -> float | None:
        if (stated := meta.get(key)) is None:
            return None
        with suppress(ValueError):
            if above < float(stated) < math.inf:
                return float(stated)
        warnings.append(_unusable(key, stated, limit))
        return None

    def choice(key: str, choices: tuple[str, ...]) -> str | None:
        stated = meta.get(key)
        if stated is None or stated in choices:
            return stated
        warnings.append(_unusable(key, stated, ", ".join(choices)))
        return None

    start_mark = choice("start_mark", START_MARKS)
    jaw_1_deg = number("jaw_1_deg", -math.inf, "deg")
    header = TraceHeader(
        state=meta.get("state", "unknown"),
        direction=choice("direction", DIRECTIONS),
        start_mark=start_mark,
        jaw_1_deg=0.0 if jaw_1_deg is None and start_mark == "jaw 1" else jaw_1_deg,
        filter_upr=number("filter_upr", 0.0, "> 0 UPR"),
        radius_mm=number("radius_mm", 0.0, "> 0 mm"),
        size=choice("size", SIZES),
        method=choice("method", METHODS),
        turns=int(meta.get("turns", "1")),
    )
    return header, tuple(warnings)


def _unusable(key: str, stated: str, limit: str) -> Problem:
    return Problem(code="trace.header_value", key=key, value=printable(stated, 60) or '""', limit=limit)
