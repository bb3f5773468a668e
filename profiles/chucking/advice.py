"""The clamping adviser: the least force that holds the part, and the most that it tolerates.

The least force holds the cut at speed (VDI 3106); it is where `rule.grip_need` begins to hold. The most is the
least of what the chuck gives, what the wall bears, and what the spread of the wrench leaves of the tolerance; it
is where the first rule of these begins to fail. Forces are totals over all jaws at rest, in N.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from profiles.chucking.grip import (
    CUT_SAFETY,
    centrifugal_loss_n,
    force_sd_n,
    least_force_n,
    line_sd_n,
    lobe_um_per_n,
    mass_radius_kg_m,
    most_loss_speed_rpm,
    needed_grip_n,
    permitted_speed_rpm,
    wrench_force_sd_n,
)
from profiles.chucking.holding import Wrench, holding_of, torque_n_m
from profiles.chucking.ring import Ring, is_thin, jaw_stress_mpa
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_or_none

MOST_DIGITS = 6  # of a newton, behind the point


class ForcePosition(StrEnum):
    """The position of a force relative to the permitted span; `NONE`: no force is permitted."""

    INSIDE = "inside"
    BELOW = "below"
    ABOVE = "above"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSpan:
    """The permitted forces at rest for one job, N; none where the least exceeds the most.

    `binding` names the limit at which `most_n` lies: "chuck", "wall" (a thin part yields) or "scatter" (the lobe
    changes by the tolerance from clamping to clamping, one standard deviation). `limits_n` has each of these that
    there is.
    """

    least_n: float
    most_n: float
    binding: str
    limits_n: Mapping[str, float]

    @property
    def empty(self) -> bool:
        """Whether no force is permitted."""
        return self.least_n > self.most_n

    @property
    def shown_n(self) -> tuple[str, str]:
        """Both ends in newtons, rounded inwards: a displayed limit is accepted when typed.

        They are whole, but for a span that lies between two whole newtons. Of none, both numbers.
        """
        for digits in range(MOST_DIGITS + 1):
            scale = 10**digits
            least, most = math.ceil(self.least_n * scale) / scale, math.floor(self.most_n * scale) / scale
            if self.empty or least <= most:
                return f"{least:.{digits}f}", f"{most:.{digits}f}"
        return f"{self.least_n:g}", f"{self.most_n:g}"

    def stands(self, force_n: float) -> ForcePosition:
        """Return the position of a force; both ends belong to the span."""
        if self.empty:
            return ForcePosition.NONE
        return (
            ForcePosition.BELOW
            if force_n < self.least_n
            else ForcePosition.ABOVE
            if force_n > self.most_n
            else ForcePosition.INSIDE
        )


def force_span(job: Job, machine: MachineProfile) -> ForceSpan:
    """Return how hard a job must and may be clamped: the one source for form, preview and arming."""
    limits_n = _limits(job, machine)
    binding = min(limits_n, key=limits_n.__getitem__)
    return ForceSpan(
        least_n=least_force_n(_cut_n(job, machine), centrifugal_loss_n(job, machine), machine.chuck.safety_factor),
        most_n=limits_n[binding],
        binding=binding,
        limits_n=limits_n,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampingAdvice:
    """The clamping advice for one job.

    `at_rest_sd_n` is the uncertainty of one clamping's force: the root sum of squares of
    `scatter_sd_n`, from clamping to clamping, and `line_sd_n`, of the wrench's line where it was calibrated. All
    three are one standard deviation.

    At `uncompensated_n` a plain cut would be within the tolerance, None where there is no lobe. `um_per_n` is the
    lobe of the job for one newton at speed, with the job's own source. Torques are those of the machine's wrench,
    None without its calibration; the span of torques is None, too, where the wrench presses harder than the most
    without any.
    """

    span: ForceSpan
    uncompensated_n: float | None
    at_rest_n: float
    at_rest_sd_n: float
    scatter_sd_n: float
    line_sd_n: float
    at_speed_n: float
    loss_n: float
    permitted_speed_rpm: float
    um_per_n: float
    lobe_source: str
    torque_n_m: float | None
    torque_span_n_m: tuple[float, float] | None


def clamping_advice(job: Job, machine: MachineProfile) -> ClampingAdvice:
    """Return the forces for a job.

    Raises `ProfileError`: `value.out_of_range`, no torque of the wrench gives the force of the job.
    """
    span, wrench = force_span(job, machine), holding_of(machine).wrench
    loss_n, um_per_n = centrifugal_loss_n(job, machine), lobe_um_per_n(job, machine)
    force_n, of_jaws = job.chucking_force_n, mass_radius_kg_m(job, machine)
    holding_rpm = permitted_speed_rpm(force_n, _cut_n(job, machine), of_jaws, machine.chuck.safety_factor)
    return ClampingAdvice(
        span=span,
        uncompensated_n=loss_n + job.roundness_tolerance_um / um_per_n if um_per_n > 0 else None,
        at_rest_n=force_n,
        at_rest_sd_n=wrench_force_sd_n(job, machine),
        scatter_sd_n=force_sd_n(job, machine),
        line_sd_n=line_sd_n(job, machine),
        at_speed_n=force_n - loss_n,
        loss_n=loss_n,
        permitted_speed_rpm=min(holding_rpm, most_loss_speed_rpm(force_n, of_jaws)),
        um_per_n=um_per_n,
        lobe_source=job.lobe_error_source,
        torque_n_m=None if wrench is None else torque_n_m(wrench, force_n),
        torque_span_n_m=None if wrench is None else _torques_n_m(wrench, span),
    )


def _torques_n_m(wrench: Wrench, span: ForceSpan) -> tuple[float, float] | None:
    """Return the span of torques; from 0 where the wrench exceeds the least force without any."""
    if span.most_n <= wrench.offset_n:
        return None
    least = 0.0 if span.least_n <= wrench.offset_n else torque_n_m(wrench, span.least_n)
    return least, torque_n_m(wrench, span.most_n)


def _cut_n(job: Job, machine: MachineProfile) -> float:
    return needed_grip_n(job, machine) / CUT_SAFETY


def _limits(job: Job, machine: MachineProfile) -> dict[str, float]:
    limits_n = {"chuck": machine.chuck.max_force_n}
    um_per_n = lobe_um_per_n(job, machine)
    if um_per_n > 0:
        limits_n["scatter"] = job.roundness_tolerance_um / (um_per_n * holding_of(machine).limit_force_sd_fraction)
    material, stress_mpa = material_or_none(job.material), wall_stress_mpa(job, machine, 1 / job.jaws)
    if material is not None and stress_mpa is not None:
        limits_n["wall"] = material.yield_mpa / stress_mpa
    return limits_n


def wall_stress_mpa(job: Job, machine: MachineProfile, force_per_jaw_n: float) -> float | None:
    """Return the stress under a jaw; None of a part that does not bend, or of an unknown material."""
    material = material_or_none(job.material)
    if material is None or not is_thin(job.wall_thickness_mm, job.radius_mm):
        return None
    ring = Ring(
        outside_mm=job.diameter_mm,
        wall_mm=job.wall_thickness_mm,
        length_mm=holding_of(machine).limit_jaw_length_mm,
        material=material,
    )
    return jaw_stress_mpa(ring, job.jaws, force_per_jaw_n)
