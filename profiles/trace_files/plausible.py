"""Whether a trace can be one of a part of its job: its unit, and the size that it states.

Numbers in mm under a header in um read as a part that no lathe turns, the reverse as none that was turned. A unit
is doubted only where the next one would do, and where nobody has stated that it was checked.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from profiles.problem import Problem

if TYPE_CHECKING:
    from profiles.job import Job

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
