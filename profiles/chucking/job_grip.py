"""The grip of a job at speed, what its cut needs, and the effect of one newton of it on the lobe.

Forces are totals over all jaws, in N; the formulas are those of `profiles.chucking.grip` (VDI 3106). No heavy
imports, because a form calls this at every key.
"""

from __future__ import annotations

import math

from profiles.chucking.grip import CUT_SAFETY, cut_grip_n
from profiles.chucking.grip import centrifugal_loss_n as loss_n
from profiles.chucking.holding import holding_of, torque_or_none_n_m
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_or_none


def mass_radius_kg_m(job: Job, machine: MachineProfile) -> float:
    """Return M_c, the sum of mass times radius of the jaws."""
    return job.jaws * machine.chuck.jaw_mass_kg * machine.chuck.jaw_radius_mm / 1000


def centrifugal_loss_n(job: Job, machine: MachineProfile) -> float:
    """Return the chucking force that the jaws' own mass takes away at speed: F_c = sum(m r) (pi n / 30)^2."""
    return loss_n(mass_radius_kg_m(job, machine), job.spindle_speed_rpm)


def grip_margin_n(job: Job, machine: MachineProfile) -> float:
    """Return the usable clamping force at speed: F_sp0 / S_sp - F_c (VDI 3106)."""
    return job.chucking_force_n / machine.chuck.safety_factor - centrifugal_loss_n(job, machine)


def needed_grip_n(job: Job, machine: MachineProfile) -> float:
    """Return the required grip margin: S_z F_spz of the cut; 0 for a material without data."""
    material, holding = material_or_none(job.material), holding_of(machine)
    if material is None:
        return 0.0
    return CUT_SAFETY * cut_grip_n(
        cutting_force(material, job.depth_of_cut_mm, job.feed_mm_per_rev),
        friction=holding.friction,
        overhang_mm=job.overhang_mm,
        jaw_length_mm=holding.jaw_length_mm,
    )


def lobe_um_per_n(job: Job, machine: MachineProfile) -> float:
    """Return the job's own lobe per newton of grip at speed, um p-p: E / (F_sp0 - F_c) as it was found.

    0 where the jaws held nothing then.
    """
    found_rpm = job.lobe_spindle_speed_rpm or job.spindle_speed_rpm
    held_n = job.error_force_n - loss_n(mass_radius_kg_m(job, machine), found_rpm)
    return job.lobe_error_um_pp / held_n if held_n > 0 else 0.0


def force_sd_n(job: Job, machine: MachineProfile) -> float:
    """Return the scatter of the chucking force at rest between clampings, one standard deviation."""
    return holding_of(machine).force_sd_share * job.chucking_force_n


def line_sd_n(job: Job, machine: MachineProfile) -> float:
    """Return the uncertainty of the wrench line's mean force at the torque of a job, one standard deviation.

    0 without a calibrated uncertainty, and where no torque gives that force.
    """
    wrench = holding_of(machine).wrench
    torque_n_m = None if wrench is None else torque_or_none_n_m(wrench, job.chucking_force_n)
    return 0.0 if wrench is None or torque_n_m is None else wrench.line_sd_n(torque_n_m)


def wrench_force_sd_n(job: Job, machine: MachineProfile) -> float:
    """Return the uncertainty of one clamping's force, one standard deviation.

    Combines the scatter between clampings and the uncertainty of the calibrated line from torque to force.
    """
    return math.hypot(force_sd_n(job, machine), line_sd_n(job, machine))
