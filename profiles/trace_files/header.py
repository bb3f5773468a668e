"""The meaning of the `# key: value` lines of a trace: how it was measured, and whether its numbers can be true.

Some keys change the numbers and are applied while the file is read (`units`, `angles`, `angle_range`, `decimal`);
the rest is kept here. What a trace does not state is unknown, never assumed.

Numbers in mm under a header in um read as a part that no lathe turns, the reverse as one rounder than any. A unit
is doubted only if the next one would do, and if nobody has stated that it was checked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from profiles.files import printable
from profiles.job import Job
from profiles.problem import Problem

if TYPE_CHECKING:
    from profiles.job import Job

DIRECTIONS = ("spindle", "cw", "ccw")
"""Direction of the angles over the part, seen from the tailstock. Those of a spindle that turns
counter-clockwise in the cut (M3), taken at the tool, run clockwise over the part: `spindle` and `cw` are the
same."""
START_MARKS = ("spindle index", "jaw 1", "unknown")  # the mark at angle 0
Z_FROM = ("jaw faces", "free end")
"""Where heights are counted from: towards the free end, or from it into the part, with either sign."""

METHODS = ("radial", "v_block", "two_point")
SIZES = ("absolute", "relative")
GAUGE_ERROR = "gauge_error"  # header line: which error of the gauge was taken off the deviations
NUMBERS_READ = "numbers_read"  # added by the reader: a number of the file with its reading
# Keys that are applied while the file is read and then dropped:
APPLIED = ("units", "angles", "angle_range", "decimal")
LEAST_RONT_UM = 0.25
"""An eighth of the 2 um that can be promised of the best lathe (choice)."""

MOST_RONT_UM = 1000.0
"""The largest lobe that a job may state: nobody turns a part that is further from round."""

LEAST_POINTS_MM, MOST_POINTS_MM = 1.0, 1000.0  # diameter of what a chuck of this kind clamps (choice)
MOST_OFF_SIZE_MM = 0.5  # on the radius: more is another part, or a diameter in place of a radius (choice)
CHECKED = ("units_checked", "yes")  # header line by which a person states that the unit is right
DIAMETER_STATED = "lobe.diameter_stated"
_STEP = 1000.0  # from one unit to the next: nm, um, mm
_SIMULATED = ("simulated", "yes")  # an ideal lathe is rounder than any real one


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceHeader:
    """How a trace was measured; None where it is not stated.

    `direction` is one of `DIRECTIONS`, `start_mark` one of `START_MARKS`, `jaw_1_deg` the angle of jaw 1 in the
    angles of the trace (0 where jaw 1 is the start mark). `filter_upr` is the cut-off of a filter that the
    instrument has applied, `radius_mm` the radius at which the deviation is 0. `size` "relative" means that the
    instrument does not measure size, so that the mean deviation has no meaning. `method` is how it was
    measured, one of `METHODS`. `turns` of the part follow each other. `z_from`, one of `Z_FROM`, is where the
    heights of sections are counted from.
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
    z_from: str | None = None

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
        z_from=choice("z_from", Z_FROM),
    )
    return header, tuple(warnings)


def _unusable(key: str, stated: str, limit: str) -> Problem:
    return Problem(code="trace.header_value", key=key, value=printable(stated, 60) or '""', limit=limit)


def unit_doubt(ront_um: float, meta: Mapping[str, str], *, plane: bool = False) -> tuple[Problem, ...]:
    """Return why the unit of a trace with these header lines is probably wrong; nothing where it may be right.

    Points in the `plane` have a size, which tells their unit better than RONt does.
    """
    if any(meta.get(key) == value for key, value in (CHECKED, _SIMULATED)):
        return ()
    if plane:
        diameter_mm = 2.0 * float(meta["radius_mm"])
        if LEAST_POINTS_MM <= diameter_mm <= MOST_POINTS_MM:
            return ()
        other_mm = diameter_mm / _STEP if diameter_mm > MOST_POINTS_MM else diameter_mm * _STEP
        value, limit = f"D {diameter_mm:.4g} mm", f"D {other_mm:.4g} mm"
        return (Problem(code="trace.unit_doubtful_points", key="x_mm,y_mm", value=value, limit=limit),)
    if ront_um < LEAST_RONT_UM and ront_um * _STEP >= LEAST_RONT_UM:
        code, other_um, unit = "trace.unit_doubtful", ront_um * _STEP, "deviation_mm"
    elif ront_um > MOST_RONT_UM and ront_um / _STEP <= MOST_RONT_UM:
        code, other_um, unit = "trace.unit_doubtful_large", ront_um / _STEP, "deviation_um"
    else:
        return ()
    return (Problem(code=code, key=unit, value=_um(ront_um), limit=_um(other_um)),)


def _um(size_um: float) -> str:
    return f"{size_um:.0f} um" if size_um >= 100.0 else f"{size_um:.3g} um"


def size_doubt(radius_mm: float, job: Job) -> Problem | None:
    """Return why a mean radius is not that of a part of this job; None where it may be.

    A value that would do as the diameter is probably one.
    """
    found_mm, target_mm = radius_mm, job.finished_radius_mm
    if abs(found_mm - target_mm) <= MOST_OFF_SIZE_MM:
        return None
    is_diameter = abs(found_mm / 2.0 - target_mm) <= MOST_OFF_SIZE_MM
    code = DIAMETER_STATED if is_diameter else "lobe.other_size"
    value, limit = f"{found_mm:.3f} mm", f"{target_mm:.3f} mm"
    return Problem(code=code, key="radius_mm", value=value, limit=limit)
