"""The clamping adviser: how hard the part must be held, and how hard it may be, side by side.

The least force holds the cut at speed (VDI 3106); it is where `rule.grip_need` begins to hold. The most is the
least of what the chuck gives, what the wall bears, and what the spread of the wrench leaves of the tolerance.
Forces are totals over all jaws at rest, in N.
"""

from __future__ import annotations

from dataclasses import dataclass

from profiles.chucking.grip import CUT_SAFETY, least_force_n, most_loss_speed_rpm, permitted_speed_rpm
from profiles.chucking.holding import Holding, holding_of
from profiles.chucking.ring import Ring, bending_stress_mpa, is_thin
from profiles.chucking.wrench import Wrench, torque_n_m
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_or_none
from profiles.problem import Problem
from profiles.rules import (
    Finding,
    Severity,
    centrifugal_loss_n,
    check,
    lobe_um_per_n,
    mass_radius_kg_m,
    needed_grip_n,
)

_OF_CLAMPING = (
    "rule.force_over_chuck",
    "rule.grip_margin",
    "rule.grip_need",
    "rule.grip_loss",
    "rule.material_unknown",
    "rule.clamp_stress",
    "rule.clamp_scatter",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampingAdvice:
    """What is advised for one job.

    `minimum_n` to `maximum_n` is the span of forces at rest; it is empty where the first is the larger one.
    `limits_n` says where each limit lies: "chuck", "wall" (a thin part yields), "scatter" (the lobe changes by the
    tolerance from clamping to clamping, one standard deviation), "uncompensated" (a plain cut would be within the
    tolerance; no limit of a compensated one); what does not limit is not in it. `um_per_n` is the lobe of the job
    for one newton at speed, with the job's own source. Torques are those of the machine's wrench, None without its
    calibration.
    """

    minimum_n: float
    maximum_n: float
    at_rest_n: float
    at_rest_sd_n: float
    at_speed_n: float
    loss_n: float
    permitted_speed_rpm: float
    limits_n: dict[str, float]
    um_per_n: float
    lobe_source: str
    torque_n_m: float | None
    torque_span_n_m: tuple[float, float] | None
    findings: tuple[Finding, ...]


def clamping_advice(job: Job, machine: MachineProfile) -> ClampingAdvice:
    """Return the forces for a job, and every finding about its own."""
    holding = holding_of(machine)
    loss_n = centrifugal_loss_n(job, machine)
    cut_n = needed_grip_n(job, machine) / CUT_SAFETY
    limits_n = _limits(job, machine, holding, loss_n)
    minimum_n = least_force_n(cut_n, loss_n, machine.chuck.safety_factor)
    maximum_n = min(force for name, force in limits_n.items() if name != "uncompensated")
    of_rules = tuple(f for f in check(job, machine) if f.problem.code in _OF_CLAMPING)
    wrench = holding.wrench
    return ClampingAdvice(
        minimum_n=minimum_n,
        maximum_n=maximum_n,
        at_rest_n=job.chucking_force_n,
        at_rest_sd_n=holding.force_sd_share * job.chucking_force_n,
        at_speed_n=job.chucking_force_n - loss_n,
        loss_n=loss_n,
        permitted_speed_rpm=_speed_rpm(job, machine, cut_n),
        limits_n=limits_n,
        um_per_n=lobe_um_per_n(job, machine),
        lobe_source=job.lobe_error_source,
        torque_n_m=None if wrench is None else torque_n_m(wrench, job.chucking_force_n),
        torque_span_n_m=None if wrench is None else _torques_n_m(wrench, minimum_n, maximum_n),
        findings=(*of_rules, _span(minimum_n, maximum_n)),
    )


def _torques_n_m(wrench: Wrench, minimum_n: float, maximum_n: float) -> tuple[float, float]:
    """Return the span of torques; from 0 on where the wrench presses harder than the least without any."""
    least = 0.0 if minimum_n <= wrench.offset_n else torque_n_m(wrench, minimum_n)
    return least, torque_n_m(wrench, maximum_n)


def _speed_rpm(job: Job, machine: MachineProfile, cut_n: float) -> float:
    force_n, of_jaws = job.chucking_force_n, mass_radius_kg_m(job, machine)
    return min(
        permitted_speed_rpm(force_n, cut_n, of_jaws, machine.chuck.safety_factor),
        most_loss_speed_rpm(force_n, of_jaws),
    )


def _limits(job: Job, machine: MachineProfile, holding: Holding, loss_n: float) -> dict[str, float]:
    limits_n = {"chuck": machine.chuck.max_force_n}
    um_per_n, tolerance_um = lobe_um_per_n(job, machine), job.roundness_tolerance_um
    if um_per_n > 0:
        limits_n["scatter"] = tolerance_um / (um_per_n * holding.force_sd_share)
        limits_n["uncompensated"] = loss_n + tolerance_um / um_per_n
    material = material_or_none(job.material)
    if material is not None and is_thin(job.wall_thickness_mm, job.radius_mm):
        ring = Ring(
            outside_mm=job.diameter_mm,
            wall_mm=job.wall_thickness_mm,
            length_mm=holding.jaw_length_mm,
            material=material,
        )
        limits_n["wall"] = material.yield_mpa / bending_stress_mpa(ring, job.jaws, 1 / job.jaws)
    return limits_n


def _span(minimum_n: float, maximum_n: float) -> Finding:
    problem = Problem(
        code="rule.clamp_span", key="chucking_force_n", value=f"{minimum_n:.6g} N", limit=f"<= {maximum_n:.6g} N"
    )
    return Finding(severity=Severity.OK if minimum_n <= maximum_n else Severity.WARNING, problem=problem)
