"""From wrench torque to jaw force.

A chuck's own calibration with a load cell is better than any formula. Forces are totals over all jaws, in N,
torques in N m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from profiles.problem import refused


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrench:
    """Force = `offset_n` + `force_per_torque_n_per_n_m` x torque.

    `variance` is that of the offset (N^2), of both together, and of the slope; 0 where the line is only stated.
    """

    force_per_torque_n_per_n_m: float
    offset_n: float = 0.0
    variance: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def line_sd_n(self, torque_n_m: float) -> float:
        """Return the uncertainty of the line's mean force at a torque, one standard deviation, N."""
        v00, v01, v11 = self.variance
        return math.sqrt(max(v00 + 2 * v01 * torque_n_m + v11 * torque_n_m**2, 0.0))


def torque_n_m(wrench: Wrench, force: float) -> float:
    """Return the torque for a force in N, above the offset of the calibration.

    Raises `ProfileError`: `value.out_of_range`, a force that no torque gives.
    """
    torque = torque_or_none_n_m(wrench, force)
    if torque is None:
        value, limit = f"{force:.6g} N", f"> {max(wrench.offset_n, 0.0):.6g} N"
        raise refused("value.out_of_range", key="chucking_force_n", value=value, limit=limit)
    return torque


def torque_or_none_n_m(wrench: Wrench, force: float) -> float | None:
    """Return the torque for a force in N, None for a force that no torque gives."""
    if not force > max(wrench.offset_n, 0.0):
        return None
    return (force - wrench.offset_n) / wrench.force_per_torque_n_per_n_m
