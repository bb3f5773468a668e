"""The roundness gauge of the simulated shop: it takes the trace of a released part."""

from __future__ import annotations

from drivers.simulator.plant.workpiece import Workpiece
from profiles.traces import Trace


def measure_released(part: Workpiece, section: int, nominal_radius_mm: float) -> Trace:
    """Return 3600 deviations (um, outward) from the nominal radius, angles from the spindle index."""
    angle_deg, deviation_um = part.released_um(section, nominal_radius_mm)
    meta = {"state": "free", "simulated": "yes", "radius_mm": f"{nominal_radius_mm:g}"}
    return Trace(angle_deg=angle_deg, deviation_um=deviation_um, meta=meta)
