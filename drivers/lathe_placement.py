"""A simulated lathe that does not begin at power-up: its axes stand somewhere, and a blank may be clamped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from profiles.job import Job


@dataclass(frozen=True, slots=True, kw_only=True)
class LathePlacement:
    """Where a simulated lathe begins.

    `axes` are tool (mm), carriage (mm) and spindle (turns), from their flags and the index, with the controller
    homed there; None leaves them where a lathe is at power-up, not homed. `jaw_1_deg` and `tip_radius_mm` are
    where jaw 1 and the tool tip are, as `TrueParameters` has them; None is by chance. `job` has its blank clamped.
    """

    axes: tuple[float, float, float] | None = None
    jaw_1_deg: float | None = None
    tip_radius_mm: float | None = None
    job: Job | None = None


def placed_text(placed: LathePlacement) -> str:
    """Return it as one line of ASCII."""
    import json  # not for the first page

    plain = {name: getattr(placed, name) for name in ("axes", "jaw_1_deg", "tip_radius_mm")}
    job = None if placed.job is None else {k: v for k, v in asdict(placed.job).items() if v is not None}
    return json.dumps({**plain, "job": job})


def placed_of(text: str) -> LathePlacement:
    """Return what such a line says. Raises ValueError, TypeError, KeyError and `ProfileError` of any other."""
    from profiles.job import job_from_table
    from profiles.strict_values import from_json, number

    found: Mapping[str, Any] = from_json(text)
    axes = found["axes"]
    tool, carriage, spindle = (None, None, None) if axes is None else map(number, axes)
    return LathePlacement(
        axes=None if tool is None or carriage is None or spindle is None else (tool, carriage, spindle),
        **{key: None if found[key] is None else number(found[key]) for key in ("jaw_1_deg", "tip_radius_mm")},
        job=None if found["job"] is None else job_from_table(found["job"]),
    )
