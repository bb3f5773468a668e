"""From the torque on the key to the force of the jaws, with what is not known of it.

A chuck's own calibration with a load cell is better than any formula: 5 % of scatter at best, 10 % as usual.
Forces are totals over all jaws, in N, torques in N m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from profiles.problem import Problem, ProfileError


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrench:
    """Force = `offset_n` + `force_per_torque_n_per_n_m` x torque; it scatters with `sd_share` of itself."""

    force_per_torque_n_per_n_m: float
    offset_n: float = 0.0
    sd_share: float = 0.10


def force_n(wrench: Wrench, torque_n_m: float) -> tuple[float, float]:
    """Return the force of a torque and its standard deviation.

    Raises:
        ProfileError: `value.out_of_range`, a torque that presses no jaw.
    """
    force = wrench.offset_n + wrench.force_per_torque_n_per_n_m * torque_n_m
    if not torque_n_m > 0 or not force > 0:
        least = max(0.0, -wrench.offset_n / wrench.force_per_torque_n_per_n_m)
        value, limit = f"{torque_n_m:.6g} N m", f"> {least:.6g} N m"
        raise ProfileError(Problem(code="value.out_of_range", key="torque_n_m", value=value, limit=limit))
    return force, wrench.sd_share * force


def torque_n_m(wrench: Wrench, force: float) -> float:
    """Return the torque for a force in N, above the offset of the calibration.

    Raises:
        ProfileError: `value.out_of_range`, a force that no torque gives.
    """
    if not force > max(wrench.offset_n, 0.0):
        value, limit = f"{force:.6g} N", f"> {max(wrench.offset_n, 0.0):.6g} N"
        raise ProfileError(Problem(code="value.out_of_range", key="chucking_force_n", value=value, limit=limit))
    return (force - wrench.offset_n) / wrench.force_per_torque_n_per_n_m


def scroll_chuck(*, lead_mm: float, gear_ratio: float, efficiency: float) -> Wrench:
    """Return the wrench of a scroll chuck from its drawing: F = 2 pi eta i Tq / p. Its efficiency is a guess."""
    return Wrench(force_per_torque_n_per_n_m=2000 * math.pi * efficiency * gear_ratio / lead_mm)
