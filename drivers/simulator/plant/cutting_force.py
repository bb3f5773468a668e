"""What a cut asks of spindle and tool: the main force of the law by which it is predicted, at the true edge."""

from __future__ import annotations

from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.materials import MATERIALS, Material, material_or_none

ALUMINIUM = MATERIALS[0]
"""Wrought, not hardenable: what is cut where a job names a material of which nothing is known."""


def material_of(job: Job) -> Material:
    """Return what the part of a job really is."""
    return material_or_none(job.material) or ALUMINIUM


def cutting_force_n(
    depth_mm: float, feed_mm_per_rev: float, material: Material = ALUMINIUM, edge_n_per_mm: float = 0.0
) -> float:
    """Return the main force on a tool that stands square to the axis; `edge_n_per_mm` is that on no chip."""
    return cutting_force(material, depth_mm, feed_mm_per_rev, edge_n_per_mm=edge_n_per_mm).main_n


def cutting_torque_n_m(job: Job) -> float:
    """Return the torque of the cut of a job."""
    return cutting_force_n(job.depth_of_cut_mm, job.feed_mm_per_rev, material_of(job)) * job.radius_mm / 1000.0
