"""Surface of a part that was measured in sections, unrolled over angle x Z, as it is drawn and kept in the record.

Each section is through the filter round of its roundness, at whole degrees, so that a part takes some kilobytes.
Angles in degrees, Z in mm, deviations in um, positive where the part is high.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from profiles.arrays import Floats, floats
from profiles.metrology.circles import LEAST_SQUARES, limacon_circle
from profiles.metrology.cylindricity import LEAST_SECTIONS, PartSection
from profiles.roundness import profile_of
from profiles.strict_values import number

PROFILES = "profiles"
TURN_DEG = floats(np.arange(360.0))
_CIRCLE = (np.ones(360), np.cos(np.radians(TURN_DEG)), np.sin(np.radians(TURN_DEG)))
MOST_KEPT = 25
"""Sections of which a record keeps the profile; of more, as many at even distances and the worst."""

_KEPT_DIGITS = 3  # um: a nanometre
_COLUMNS = ("z_mm", "RONt_um", "deviation_um")


@dataclass(frozen=True, kw_only=True, eq=False)
class UnrolledPart:
    """S sections from the lowest Z up.

    `z_mm` and their roundness `ront_um` have the shape (S,); `deviation_um` at `TURN_DEG`, (S, 360), has the mean
    and the centre with which they were measured.
    """

    z_mm: Floats
    ront_um: Floats
    deviation_um: Floats

    @property
    def worst(self) -> int:
        """Index of the section that is least round."""
        return int(self.ront_um.argmax())

    @cached_property
    def round_um(self) -> Floats:
        """Deviations of each section from its own least squares circle, shape (S, 360)."""
        return np.stack([_left(row, *_CIRCLE) for row in self.deviation_um])

    @cached_property
    def cylinder_um(self) -> Floats:
        """Deviations from the least squares cylinder, shape (S, 360).

        The axis of the minimum zone may tilt freely where one section alone determines the zone: on a map it would
        look like an error of the part.
        """
        shape, z_mm = self.deviation_um.shape, self.z_mm[:, None] - self.z_mm.mean()
        tilts = [z_mm * each for each in _CIRCLE[1:]]
        columns = [np.broadcast_to(each, shape).ravel() for each in (*_CIRCLE, *tilts)]
        return _left(self.deviation_um.ravel(), *columns).reshape(shape)

    def event(self) -> dict[str, object]:
        """Return what the record keeps of it: `MOST_KEPT` sections at most."""
        kept = list(range(self.z_mm.size))
        if self.z_mm.size > MOST_KEPT:
            even = np.linspace(0, self.z_mm.size - 1, MOST_KEPT - 1).round().astype(int).tolist()
            kept = sorted({*even, self.worst})
        columns = (self.z_mm.tolist(), self.ront_um.tolist(), self.deviation_um.round(_KEPT_DIGITS).tolist())
        rows = list(zip(*columns, strict=True))
        return {PROFILES: [dict(zip(_COLUMNS, rows[each], strict=True)) for each in kept]}

    def table(self, **meta: str) -> str:
        """Return it as a file of sections with these header lines, see `profiles.trace_files.sections`."""
        rows = zip(self.z_mm.tolist(), self.deviation_um.tolist(), strict=True)
        points = [f"{z!r},{angle:g},{um!r}" for z, row in rows for angle, um in zip(TURN_DEG, row, strict=True)]
        head = [f"# {key}: {value}" for key, value in {"filtered": "yes", **meta}.items()]
        return "\n".join([*head, "z_mm,angle_deg,deviation_um", *points, ""])


def unroll(sections: Sequence[PartSection], filter_upr: float | None) -> UnrolledPart:
    """Return the unrolled surface of sections."""
    rising = sorted(sections, key=lambda each: each.z_mm)
    ront_um, rows = zip(*(_through_filter(each, filter_upr) for each in rising), strict=True)
    return UnrolledPart(
        z_mm=floats([each.z_mm for each in rising]), ront_um=floats(ront_um), deviation_um=np.stack(rows)
    )


def unroll_kept(event: Mapping[str, Any]) -> UnrolledPart | None:
    """Return the surface that a record has kept; None if it has none, or if that is damaged."""
    try:
        rows = [[each[name] for name in _COLUMNS] for each in event[PROFILES]]
        z_mm, ront_um = (floats([number(row[column]) for row in rows]) for column in (0, 1))
        deviation_um = floats([[number(um) for um in row[2]] for row in rows])
    except (KeyError, TypeError, ValueError):
        return None
    whole = deviation_um.shape == (z_mm.size, TURN_DEG.size) and np.unique(z_mm).size >= LEAST_SECTIONS
    return UnrolledPart(z_mm=z_mm, ront_um=ront_um, deviation_um=deviation_um) if whole else None


def _through_filter(section: PartSection, filter_upr: float | None) -> tuple[float, Floats]:
    """Return RONt of a section, and its deviations at whole degrees with the mean and the centre that it has."""
    angle_deg, profile_um = profile_of(section.angle_deg, section.deviation_um, filter_upr)
    circle = limacon_circle(LEAST_SQUARES, section.angle_deg, section.deviation_um)
    at_degrees = np.interp(TURN_DEG, angle_deg, profile_um, period=360.0)
    offsets_um = np.array([circle.deviation_um, circle.centre_x_um, circle.centre_y_um])
    return float(np.ptp(profile_um)), floats(at_degrees + offsets_um @ np.stack(_CIRCLE))


def _left(values: Floats, *columns: Floats) -> Floats:
    """Return what a least squares fit of columns leaves of values, shape (M,) each."""
    design = np.stack(columns, axis=1)
    return floats(values - design @ np.linalg.lstsq(design, values, rcond=None)[0])
