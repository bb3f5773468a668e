"""From the torque on the key to the force of the jaws.

A chuck's own calibration with a load cell is better than any formula. Forces are totals over all jaws, in N,
torques in N m.
"""

from __future__ import annotations

from dataclasses import dataclass

from profiles.problem import Problem, ProfileError


@dataclass(frozen=True, slots=True, kw_only=True)
class Wrench:
    """Force = `offset_n` + `force_per_torque_n_per_n_m` x torque."""

    force_per_torque_n_per_n_m: float
    offset_n: float = 0.0


def torque_n_m(wrench: Wrench, force: float) -> float:
    """Return the torque for a force in N, above the offset of the calibration.

    Raises:
        ProfileError: `value.out_of_range`, a force that no torque gives.
    """
    if not force > max(wrench.offset_n, 0.0):
        value, limit = f"{force:.6g} N", f"> {max(wrench.offset_n, 0.0):.6g} N"
        raise ProfileError(Problem(code="value.out_of_range", key="chucking_force_n", value=value, limit=limit))
    return (force - wrench.offset_n) / wrench.force_per_torque_n_per_n_m
