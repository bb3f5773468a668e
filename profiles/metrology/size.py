"""The size of a measured part, and the tool offset that would correct it."""

from __future__ import annotations


def mean_diameter_mm(radius_mm: float, mean_deviation_um: float) -> float:
    """Return 2 (R + mean deviation): R is where the deviation is 0, the mean that of the least squares circle."""
    return 2.0 * (radius_mm + mean_deviation_um / 1000.0)


def tool_offset_um(mean_diameter_mm: float, target_diameter_mm: float) -> float:
    """Return half of the oversize: how far the tool has to move, positive into the work."""
    return 500.0 * (mean_diameter_mm - target_diameter_mm)
