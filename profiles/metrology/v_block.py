"""The response of an indicator over a V-block to a lobed part, and the lobes that it cannot see."""

from __future__ import annotations

import math

from profiles.problem import refused

SMALLEST_FACTOR = 0.5
TWO_POINT_DEG = 180.0


def v_block_factor(lobes: int, included_deg: float) -> float:
    """Return F_n, the reading's amplitude over the lobe's; the sign is that of a maximum under the indicator.

    The part turns in a V of included angle 2 h, the indicator is on the bisector opposite the V:
    F_n = 1 + (-1)^n cos(n (90 deg - h)) / sin h. A V of 180 deg is the measurement of a diameter: 0 for odd n.
    Raises `ProfileError`: `value.out_of_range`, fewer than 2 lobes, or an angle outside of 0 to 180 deg.
    """
    if lobes < 2:
        raise refused("value.out_of_range", key="lobes", value=str(lobes), limit=">= 2")
    if not 0.0 < included_deg <= TWO_POINT_DEG:
        value, limit = f"{included_deg:g}", "> 0, < 180 deg"
        raise refused("value.out_of_range", key="vblock", value=value, limit=limit)
    half = math.radians(included_deg / 2)
    sign = -1.0 if lobes % 2 else 1.0
    return 1.0 + sign * math.cos(lobes * (math.pi / 2 - half)) / math.sin(half)


def usable_factor(lobes: int, included_deg: float) -> float:
    """Return the factor by which a reading must be divided.

    Raises as `v_block_factor`; `trace.two_point`; `trace.v_block_blind`, the factor is below `SMALLEST_FACTOR`, so
    that the lobes would hardly be read.
    """
    factor = v_block_factor(lobes, included_deg)
    if included_deg == TWO_POINT_DEG:
        raise refused("trace.two_point", key="vblock", value=f"{included_deg:g} deg")
    if abs(factor) < SMALLEST_FACTOR:
        key, limit = f"{lobes}, {included_deg:g} deg", f">= {SMALLEST_FACTOR:g}"
        raise refused("trace.v_block_blind", key=key, value=f"{abs(factor):.3f}", limit=limit)
    return factor
