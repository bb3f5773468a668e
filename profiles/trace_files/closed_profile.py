"""Common parts of the surface-texture formats: one profile at equal steps, taken as one closed turn.

None of them can express closed profiles, start marks or directions: heights are along a line. Such a profile is
taken as one turn, so that its length, the number of points times the step, is the circumference. The phase stays
unknown, and so does the size: the heights are from any zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from profiles.files import printable
from profiles.problem import ProfileError, refusal_error
from profiles.trace_files.limits import MOST_POINTS, too_large
from profiles.trace_files.number_marks import point_number
from profiles.trace_files.table import FEWEST_POINTS, LARGEST_DEVIATION_UM

Content = TypeVar("Content", bytes, str)
"""The content of a file: its bytes, or their text."""

UM_PER_M = 1e6
ABOVE_ZERO = math.ulp(0.0)  # the smallest step or scale


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedProfile:
    """Deviations in um at equal angles, and the radius in mm that the step implies (None without a step)."""

    format: str
    deviation_um: list[float]
    radius_mm: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceFormat(Generic[Content]):
    """A format: its common name, its standard, and how a file of it is recognised and read.

    `read` takes the content and the file's name for problems; it raises `ProfileError`.
    """

    name: str
    standard: str
    begins: Callable[[Content], object]
    read: Callable[[Content, str], ClosedProfile]


def close_profile(kind: str, deviation_um: list[float], points: float, step_m: float, where: str) -> ClosedProfile:
    """Return a profile with as many points as its file states; a `step_m` of 0 means none."""
    if len(deviation_um) != points:
        actual = f"> {points:g}" if len(deviation_um) > points else f"{len(deviation_um)}"
        raise unusable(where, f"{kind}: points", actual, f"{points:g}")
    radius_mm = 1000.0 * points * step_m / (2.0 * math.pi)
    return ClosedProfile(format=kind, deviation_um=deviation_um, radius_mm=radius_mm or None)


def point_count(stated: str, key: str, where: str) -> float:
    """Return a number of points that a trace may have."""
    value, code = point_number(stated)
    if not code and value > MOST_POINTS:
        raise too_large(f"{where}: {key}", f"{value:.0f} points", f"{MOST_POINTS} points")
    return number(stated, key, where, FEWEST_POINTS, MOST_POINTS)


def number(stated: str, key: str, where: str, least: float, most: float) -> float:
    """Return a number from a file's header that is within bounds."""
    value, code = point_number(stated)
    if code or not least <= value <= most:
        raise unusable(where, key, stated, f"{least:g} - {most:g}")
    return value


def heights_um(cells: Iterable[tuple[str, str]], um_per_unit: float, points: float) -> list[float]:
    """Return heights in um of cells, each with its position; at most one beyond the header's `points`.

    Raises `ProfileError`: `trace.not_number`, `trace.not_finite` (a value marked BAD, too), `trace.out_of_range`.
    """
    found = []
    for place, cell in cells:
        value, code = point_number(cell)
        value_um = value * um_per_unit
        if code or abs(value_um) > LARGEST_DEVIATION_UM:
            limit, shown = f"<= {LARGEST_DEVIATION_UM:g} um", printable(cell, 60) or '""'
            raise refusal_error(code or "trace.out_of_range", where=place, key="Z", value=shown, limit=limit)
        found.append(value_um)
        if len(found) > points:
            break
    return found


def unusable(where: str, key: str, value: str, limit: str) -> ProfileError:
    """Return the refusal of a field that cannot be used."""
    return refusal_error("trace.format", where=where, key=key, value=printable(value, 60) or "-", limit=limit)
