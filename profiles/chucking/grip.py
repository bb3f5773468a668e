"""The grip at speed, and what the cut needs: the force rules after VDI 3106 and DIN EN 1550.

Forces are totals over all jaws, in N; F_sp0 is at rest, and the jaws grip from outside. At speed the mass of the
jaws takes F_c = sum(m r) (pi n / 30)^2 away. The usable grip is F_sp0 / S_sp - F_c; the cut needs
S_z F_spz of it. Plain numbers without heavy imports, because a form calls this at every key.
"""

from __future__ import annotations

import math

from profiles.chucking.holding import holding_of, torque_or_none_n_m
from profiles.cutting import CuttingForce, cutting_force
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_or_none

MOST_GRIP_LOSS = 0.67  # fraction of the force at rest that rotation may take (DIN EN 1550)
CUT_SAFETY = 1.5  # S_z: safety factor of the grip over what the cut needs; at least 1.5


def loss_n(mass_radius_kg_m: float, spindle_speed_rpm: float) -> float:
    """Return F_c = M_c (pi n / 30)^2, M_c the sum of mass times radius of the jaws."""
    return mass_radius_kg_m * (math.pi * spindle_speed_rpm / 30) ** 2


def cut_grip_n(cut: CuttingForce, *, friction: float, overhang_mm: float, jaw_length_mm: float) -> float:
    """Return F_spz: the clamping force below which this cut would move the part.

    Turning and pushing act at the same contacts, hypot(F_c, F_f) / mu with the cut at the diameter that is held.
    The leverage of the overhang unloads a jaw edge below 4 P (1 + a/l), P = hypot(F_c, F_p); it comes on top.
    """
    slipping_n = math.hypot(cut.main_n, cut.feed_n) / friction
    lifting_n = 4 * cut.in_plane_n * (1 + overhang_mm / jaw_length_mm)
    return slipping_n + lifting_n


def least_force_n(cut_grip: float, loss: float, chuck_safety: float) -> float:
    """Return the least F_sp0 for a cut: S_sp (S_z F_spz + F_c), and at most 67 % of it lost. All in N."""
    return max(chuck_safety * (CUT_SAFETY * cut_grip + loss), loss / MOST_GRIP_LOSS)


def permitted_speed_rpm(force_n: float, cut_grip: float, mass_radius_kg_m: float, chuck_safety: float) -> float:
    """Return n_perm = (30/pi) sqrt((F_sp0/S_sp - S_z F_spz)/M_c); 0 where the force never holds the cut.

    With `chuck_safety` 1 it is the form of the chuck makers' manuals.
    """
    return speed_of_loss_rpm(force_n / chuck_safety - CUT_SAFETY * cut_grip, mass_radius_kg_m)


def most_loss_speed_rpm(force_n: float, mass_radius_kg_m: float) -> float:
    """Return the speed at which rotation takes 67 % of the force at rest."""
    return speed_of_loss_rpm(MOST_GRIP_LOSS * force_n, mass_radius_kg_m)


def speed_of_loss_rpm(loss_n: float, mass_radius_kg_m: float) -> float:
    """Return the speed of this loss, n = (30/pi) sqrt(F_c/M_c); 0 where nothing may be lost."""
    return 30 / math.pi * math.sqrt(max(loss_n, 0.0) / mass_radius_kg_m)


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
        jaw_length_mm=holding.limit_jaw_length_mm,
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
    return holding_of(machine).force_sd_fraction * job.chucking_force_n


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
