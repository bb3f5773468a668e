"""The part of a job in the jaws of a machine, at speed and under its cut."""

from __future__ import annotations

from profiles.chucking.held_part import HeldPart
from profiles.chucking.holding import holding_of
from profiles.chucking.job_grip import centrifugal_loss_n
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_named


def held_part(job: Job, machine: MachineProfile) -> HeldPart:
    """Return the part in the jaws at speed, under its cut. Raises `ProfileError` (`rule.material_unknown`)."""
    material = material_named(job.material)
    return HeldPart(
        job=job,
        material=material,
        holding=holding_of(machine),
        force=cutting_force(material, job.depth_of_cut_mm, job.feed_mm_per_rev),
        per_jaw_n=(job.chucking_force_n - centrifugal_loss_n(job, machine)) / job.jaws,
    )
