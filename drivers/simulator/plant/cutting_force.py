"""What a cut asks of the spindle: Kienzle's main cutting force at the radius of the part."""

from __future__ import annotations

from dataclasses import dataclass

from profiles.job import Job


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Kienzle's specific force for a chip of 1 mm x 1 mm, and how it grows with thinner ones."""

    specific_n_per_mm2: float
    chip_exponent: float


ALUMINIUM = Material(specific_n_per_mm2=700.0, chip_exponent=0.25)
_STEEL = Material(specific_n_per_mm2=1500.0, chip_exponent=0.22)
_STAINLESS = Material(specific_n_per_mm2=2150.0, chip_exponent=0.20)

_MATERIALS = {"steel": _STEEL, "carbon steel": _STEEL, "stainless": _STAINLESS, "stainless steel": _STAINLESS}
"""After VDI 3323. Whatever else a job names is cut as wrought aluminium, that does not harden."""


def material_of(job: Job) -> Material:
    """Return what the part of a job really is."""
    return _MATERIALS.get(job.material.strip().lower(), ALUMINIUM)


def cutting_force_n(depth_mm: float, feed_mm_per_rev: float, material: Material = ALUMINIUM) -> float:
    """Return kc b h^(1 - m) of a tool that stands square to the axis."""
    return float(material.specific_n_per_mm2 * depth_mm * feed_mm_per_rev ** (1.0 - material.chip_exponent))


def cutting_torque_n_m(job: Job) -> float:
    """Return the torque of the cut of a job."""
    return cutting_force_n(job.depth_of_cut_mm, job.feed_mm_per_rev, material_of(job)) * job.radius_mm / 1000.0
