"""The jaws and the wrench of a machine profile; missing values are usual ones, with the names of what was assumed.

A chuck's own calibration with a load cell is better than any formula. Forces are totals over all jaws, in N,
torques in N m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from profiles.findings import Finding, Severity, judge_condition
from profiles.job import Job
from profiles.lobe.lobe_conditions import force_as_found
from profiles.machine import MachineProfile
from profiles.problem import Problem, refusal_error

JAW_LENGTH_MM = 40.0
JAW_STIFFNESS_N_PER_UM = 50.0
REFERENCE_FORCE_N = 1000.0  # force on one jaw at which its stiffness is given
CONTACT_EXPONENT = 0.5  # alpha of k ~ F^alpha: 1/3 for Hertz's smooth bodies, 1/2 for rough surfaces
STRAIGHT_FRACTION = 0.75  # of three rigid jaws of 10 degrees; soft or bored jaws have less, a whole collar 1
FRICTION = 0.12  # smooth jaws: 0.1 to 0.15
FORCE_SD_PERCENT = 5.0  # scatter between clampings with a wrench at its best
SAME_FORCE = 0.005  # relative difference at which two chucking forces are still the same setting of the wrench


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
        raise refusal_error("value.out_of_range", key="chucking_force_n", value=value, limit=limit)
    return torque


def torque_or_none_n_m(wrench: Wrench, force: float) -> float | None:
    """Return the torque for a force in N, None for a force that no torque gives."""
    if not force > max(wrench.offset_n, 0.0):
        return None
    return (force - wrench.offset_n) / wrench.force_per_torque_n_per_n_m


@dataclass(frozen=True, slots=True, kw_only=True)
class Holding:
    """The jaws as used by the predictions. `assumed` names the keys ("chuck.jaw_length_mm") that were not given.

    `stiffness_n_per_um` is one jaw's at `REFERENCE_FORCE_N`. `wrench` is None without a calibration.
    `limit_jaw_length_mm` and `limit_force_sd_fraction` are those that the limits of the force use: the stricter
    one of profile and calibration, because a calibration alone widens no limit.
    """

    jaw_length_mm: float
    stiffness_n_per_um: float
    contact_exponent: float
    friction: float
    straight_fraction: float
    bell_mouth_mm: float
    force_sd_fraction: float
    limit_jaw_length_mm: float
    limit_force_sd_fraction: float
    wrench: Wrench | None
    assumed: tuple[str, ...]


def holding_of(machine: MachineProfile) -> Holding:
    """Return the jaws of a machine."""
    chuck = machine.chuck
    given = {
        "jaw_length_mm": (chuck.jaw_length_mm, JAW_LENGTH_MM),
        "jaw_stiffness_n_per_um": (chuck.jaw_stiffness_n_per_um, JAW_STIFFNESS_N_PER_UM),
        "jaw_contact_exponent": (chuck.jaw_contact_exponent, CONTACT_EXPONENT),
        "jaw_friction": (chuck.jaw_friction, FRICTION),
        "jaw_straight_fraction": (chuck.jaw_straight_fraction, STRAIGHT_FRACTION),
        "jaw_bell_mouth_mm": (chuck.jaw_bell_mouth_mm, 0.0),
        "force_sd_percent": (chuck.force_sd_percent, FORCE_SD_PERCENT),
    }
    used = {key: usual if said is None else said for key, (said, usual) in given.items()}
    slope = chuck.force_per_torque_n_per_n_m
    return Holding(
        jaw_length_mm=used["jaw_length_mm"],
        stiffness_n_per_um=used["jaw_stiffness_n_per_um"],
        contact_exponent=used["jaw_contact_exponent"],
        friction=used["jaw_friction"],
        straight_fraction=used["jaw_straight_fraction"],
        bell_mouth_mm=used["jaw_bell_mouth_mm"],
        force_sd_fraction=used["force_sd_percent"] / 100,
        limit_jaw_length_mm=min(used["jaw_length_mm"], chuck.uncalibrated_jaw_length_mm or math.inf),
        limit_force_sd_fraction=max(used["force_sd_percent"], chuck.uncalibrated_force_sd_percent or 0.0) / 100,
        wrench=None
        if slope is None
        else Wrench(
            force_per_torque_n_per_n_m=slope,
            offset_n=chuck.force_offset_n or 0.0,
            variance=chuck.force_line_variance,
        ),
        assumed=tuple(f"chuck.{key}" for key, (said, _) in given.items() if said is None),
    )


def same_force(one_n: float, other_n: float) -> bool:
    """Whether two chucking forces are the same setting of the wrench."""
    return abs(one_n - other_n) <= SAME_FORCE * max(one_n, other_n)


def force_as_measured(job: Job) -> Finding:
    """Return whether the part is held as when its lobe error was found: the error depends on the force."""
    value, limit = f"{job.chucking_force_n:.6g} N", f"{job.error_force_n:.6g} N"
    problem = Problem(code="rule.force_differs", key="chucking_force_n", value=value, limit=limit)
    return judge_condition(force_as_found(job), problem, Severity.WARNING)
