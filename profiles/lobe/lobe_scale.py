"""The ratio of the lobe found on a part to that of the model, for the cut in which it was found.

The model predicts the shape of a lobe over angle and length well, and its size badly: that depends on a
chucking force which is rarely measured. So where a part of the job was measured, the prediction is the shape of
the model, scaled to the lobe that was found.
"""

from __future__ import annotations

from dataclasses import dataclass

from profiles.chucking.held_part import HeldPart, held_part
from profiles.chucking.tube import axial_share
from profiles.job import Job
from profiles.lobe.lobe_conditions import as_found, found_on_a_part
from profiles.machine import MachineProfile

LEAST_SEEN_UM = 0.01
"""Peak to peak below which a lobe is invisible: a tenth of the resolution of a good roundness gauge."""

LEAST_AXIAL_SHARE = 0.05
"""Fraction of its height at the jaws that a lobe needs to be scaled: near its sign change any height fits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LobeScale:
    """The lobe that was found, um p-p, `z_mm` in front of the jaws, and the model's value there.

    `source` is how it was found: "measured" or "fitted".
    """

    source: str
    found_um_pp: float
    z_mm: float
    model_um_pp: float

    @property
    def factor(self) -> float:
        """The lobe that was found over the model's."""
        return self.found_um_pp / self.model_um_pp


def lobe_scale(job: Job, machine: MachineProfile) -> LobeScale | None:
    """Return the scale; None where no part was measured, or where the model has no lobe to compare.

    Raises `ProfileError` (`rule.material_unknown`).
    """
    if not found_on_a_part(job):
        return None
    part = held_part(as_found(job), machine)
    z_mm = middle_mm(part.job)
    if part.per_jaw_n <= 0 or z_mm < 0 or not _has_a_lobe(part, z_mm):
        return None
    model_um_pp = part.error_um_pp(z_mm)
    if model_um_pp < LEAST_SEEN_UM:
        return None
    return LobeScale(
        source=job.lobe_error_source, found_um_pp=job.lobe_error_um_pp, z_mm=z_mm, model_um_pp=model_um_pp
    )


def middle_mm(job: Job) -> float:
    """Return the middle of the cut, in mm from the jaw faces."""
    return job.overhang_mm - job.cut_length_mm / 2


def _has_a_lobe(part: HeldPart, z_mm: float) -> bool:
    return not part.thin or abs(float(axial_share(part.tube, part.job.jaws, z_mm))) >= LEAST_AXIAL_SHARE
