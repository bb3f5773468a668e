"""The gauges of the simulated shop: the trace of a released part, and what the eye sees at the chuck."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.simulator.plant.collision import Collision
from drivers.simulator.plant.workpiece import Workpiece
from drivers.simulator.shop_view import ShopView
from profiles.traces import Trace


def measure_released(part: Workpiece, section: int, nominal_radius_mm: float) -> Trace:
    """Return 3600 deviations (um, outward) from the nominal radius, angles from the spindle index."""
    angle_deg, deviation_um = part.released_um(section, nominal_radius_mm)
    meta = {"state": "free", "simulated": "yes", "radius_mm": f"{nominal_radius_mm:g}"}
    return Trace(angle_deg=angle_deg, deviation_um=deviation_um, meta=meta)


def look_at(
    part: Workpiece | None,
    length_mm: tuple[float, float],
    tip_mm: float,
    turns: float,
    z_mm: float,
    jaw_1_deg: float,
    collisions: Sequence[Collision] = (),
) -> ShopView:
    """Return what is seen with the tool tip at radius `tip_mm` and Z `z_mm`, the spindle `turns` from its index.

    `length_mm` is where the part stands along Z, from its free end to the jaw faces; `jaw_1_deg` the spindle angle
    at which jaw 1 meets the mark; of `collisions` the kinds are seen.
    """
    # To a hundredth first, so that -180.001 is seen as 180 and not as -180.
    past_deg = round(360.0 * turns - jaw_1_deg, 2) % 360.0
    gap_mm = None
    if part is not None and length_mm[0] <= z_mm <= length_mm[1]:
        gap_mm = round(tip_mm - part.clamped_radius_mm(turns, z_mm), 3)
    return ShopView(
        jaw_1_past_mark_deg=round(past_deg - 360.0 if past_deg > 180.0 else past_deg, 2),
        tool_gap_mm=gap_mm,
        collisions=tuple(collision.kind.value for collision in collisions),
    )
