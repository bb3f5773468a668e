"""What a cut asks of the spindle: Kienzle's main cutting force at the radius of the part.

No cutting force acts on the tool; this is the load that makes an induction motor slip.
"""

from __future__ import annotations

from profiles.job import Job

SPECIFIC_N_PER_MM2 = 700.0
CHIP_EXPONENT = 0.25
"""Wrought aluminium after VDI 3323, for a chip of 1 mm x 1 mm, and how it grows with thinner ones."""


def cutting_force_n(depth_mm: float, feed_mm_per_rev: float) -> float:
    """Return kc b h^(1 - m) of a tool that stands square to the axis."""
    return float(SPECIFIC_N_PER_MM2 * depth_mm * feed_mm_per_rev ** (1.0 - CHIP_EXPONENT))


def cutting_torque_n_m(job: Job) -> float:
    """Return the torque of the cut of a job, as of aluminium whatever its material."""
    return cutting_force_n(job.depth_of_cut_mm, job.feed_mm_per_rev) * job.radius_mm / 1000.0
