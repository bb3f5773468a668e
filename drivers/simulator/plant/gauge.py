"""The gauges of the simulated shop: the trace of a part, and the view of the chuck."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.simulator.plant.collision import Collision
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.workpiece import ANGLES, Workpiece
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.traces import Trace

Floats = NDArray[np.float64]


class Gauge:
    """A roundness gauge: each time the part sits slightly off the axis, and each point has its noise.

    Deviations are um, positive outwards, at 3600 angles from the spindle index, in the direction in which the cut
    turned. Without a known start mark the trace begins at a random angle.
    """

    def __init__(self, true: TrueParameters) -> None:
        self._eccentricity_um = true.gauge_eccentricity_um
        self._noise_um = true.gauge_noise_um
        self._mark_known = true.gauge_mark_known
        self._chance = true.chance("gauge")
        self._generator = np.random.default_rng(self._chance.randrange(2**32))

    def trace(self, deviation_um: Floats, nominal_radius_mm: float, state: str) -> Trace:
        """Return the trace of a section that deviates by `deviation_um` from its nominal radius, shape (3600,)."""
        angle_deg: Floats = np.arange(ANGLES, dtype=np.float64) * (360.0 / ANGLES)
        read_um = deviation_um
        if self._eccentricity_um:
            towards = self._chance.uniform(0.0, 2.0 * math.pi)
            read_um = read_um + self._eccentricity_um * np.cos(np.radians(angle_deg) - towards)
        if self._noise_um:
            read_um = read_um + self._generator.normal(0.0, self._noise_um, ANGLES)
        if not self._mark_known:
            read_um = np.roll(read_um, self._chance.randrange(ANGLES))
        meta = {
            "state": state,
            "simulated": "yes",
            "radius_mm": f"{nominal_radius_mm:g}",
            "direction": "spindle",
            "start_mark": "spindle index" if self._mark_known else "unknown",
        }
        return Trace(angle_deg=angle_deg, deviation_um=read_um, meta=meta)


def look_at(
    part: Workpiece | None,
    length_mm: tuple[float, float],
    tip_mm: float,
    turns: float,
    z_mm: float,
    jaw_1_deg: float,
    collisions: Sequence[Collision] = (),
) -> WorkshopView:
    """Return the view with the tool tip at radius `tip_mm` and Z `z_mm`, the spindle `turns` from its index.

    `length_mm` is the Z range of the part, from its free end to the jaw faces; `jaw_1_deg` the spindle angle at
    which jaw 1 meets the mark; of `collisions` the kinds are seen.
    """
    # Round to a hundredth first, so that -180.001 is seen as 180 and not as -180.
    past_deg = round(360.0 * turns - jaw_1_deg, 2) % 360.0
    gap_mm = None
    if part is not None and length_mm[0] <= z_mm <= length_mm[1]:
        gap_mm = round(tip_mm - part.clamped_radius_mm(turns, z_mm), 3)
    return WorkshopView(
        jaw_1_past_mark_deg=round(past_deg - 360.0 if past_deg > 180.0 else past_deg, 2),
        tool_gap_mm=gap_mm,
        collisions=tuple(collision.kind.value for collision in collisions),
    )
