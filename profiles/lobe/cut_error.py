"""The error in the middle of a cut: its main mechanism, where it is high, and how it compares with the part.

The model predicts the shape of a lobe over angle and length well, and its size badly: that depends on a chucking
force which is rarely measured. So where a part of the job was measured, the prediction is the shape of the model,
scaled to the lobe that was found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from profiles.chucking.diagnosis import Diagnosis, Mechanism, diagnose
from profiles.chucking.held_part import HeldPart, held_part
from profiles.chucking.tube import HALF_LOBE_ANGLES, axial_fraction
from profiles.job import Job
from profiles.lobe.lobe_conditions import as_found, found_on_a_part
from profiles.machine import MachineProfile

_ANGLES = 2 * (HALF_LOBE_ANGLES - 1)  # over one lobe: those of `HeldPart.error_um_pp`, and their mirror images


# Peak to peak below which a lobe is invisible: a tenth of the resolution of a good roundness gauge.
LEAST_SEEN_UM = 0.01
LEAST_AXIAL_FRACTION = 0.05
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
    if part.per_jaw_n <= 0 or z_mm < 0 or part.job.depth_of_cut_mm >= part.job.wall_thickness_mm:
        return None
    if part.thin and abs(float(axial_fraction(part.tube, part.job.jaws, z_mm))) < LEAST_AXIAL_FRACTION:
        return None
    model_um_pp = part.error_um_pp(z_mm)
    if model_um_pp < LEAST_SEEN_UM:
        return None
    return LobeScale(
        source=job.lobe_error_source, found_um_pp=job.lobe_error_um_pp, z_mm=z_mm, model_um_pp=model_um_pp
    )


def lobe_change_um(job: Job, machine: MachineProfile) -> float | None:
    """Return the change of the lobe in the middle of the cut by one pass, um p-p, at the same force.

    At the same force a thinner wall springs back further, p-p ~ R^3 / t^3. Far from the jaws, where the lobe
    decays and changes its sign, it may also become smaller. A compensation of the previous pass is wrong by the
    change either way. The contacts of a bar do not depend on its thickness. Scaled to the lobe that was found, if
    any; None where the model has no such lobe for comparison. Raises `ProfileError` (`rule.material_unknown`).
    """
    part, scale = held_part(job, machine), lobe_scale(job, machine)
    after = part.turned_down(job.depth_of_cut_mm)
    if scale is None and found_on_a_part(job):
        return None
    if not part.thin and not after.thin:
        return 0.0
    factor = 1.0 if scale is None else scale.factor
    return factor * (after.error_um_pp(middle_mm(after.job)) - part.error_um_pp(middle_mm(job)))


def middle_mm(job: Job) -> float:
    """Return the middle of the cut, in mm from the jaw faces."""
    return job.overhang_mm - job.cut_length_mm / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class CutError:
    """The error of the released part `z_mm` in front of the jaws.

    `mechanism` is its main cause, `spring_back_um_pp` that contribution alone. `amplitude_um` and `phase_deg`
    (spindle angle, None below `LEAST_SEEN_UM`) are those of order N. `sd_um_pp` is the effect of the scatter of
    the chucking force. `measured_um_pp` is the job's own error where it was found on a part, and `diagnosis`
    the cause that its position suggests, where its angle past the jaws is known. `matching_force_n` is the
    total force at rest at which a part that springs back would show it; None where the diagnosis excludes that.
    None otherwise.
    """

    z_mm: float
    um_pp: float
    mechanism: Mechanism
    spring_back_um_pp: float
    amplitude_um: float
    phase_deg: float | None
    sd_um_pp: float
    measured_um_pp: float | None
    diagnosis: Diagnosis | None
    matching_force_n: float | None


def cut_error(part: HeldPart, loss_n: float) -> CutError:
    """Return the error in the middle of the cut; `loss_n` is the total centrifugal loss of force."""
    job, jaws = part.job, part.job.jaws
    lobe_deg = np.linspace(0.0, 360.0 / jaws, _ANGLES, endpoint=False)
    parts = part.error_parts_um(lobe_deg, np.array([middle_mm(job)]))
    turn = np.sum(list(parts.values()), axis=0)[0]
    um_pp = float(np.ptp(turn))
    sprung = parts.get(Mechanism.SPRING_BACK)
    sprung_um = 0.0 if sprung is None else float(np.ptp(sprung))
    wave = complex(2 / _ANGLES * np.sum(turn * np.exp(-1j * jaws * np.radians(lobe_deg))))
    phase_deg = job.jaw_1_deg - float(np.degrees(np.angle(wave))) / jaws
    largest = max(parts, key=lambda which: float(np.ptp(parts[which])))
    at_speed_n = part.per_jaw_n * jaws
    measured = job.lobe_error_um_pp if found_on_a_part(job) else None
    seen, past_deg, matching = None, job.lobe_past_jaw_deg, None
    if measured and past_deg is not None:
        seen = diagnose(phase_deg=past_deg, jaw_1_deg=0.0, jaws=jaws, thin=part.thin)
    sprung_back = seen is None or seen.mechanism is Mechanism.SPRING_BACK
    if measured is not None and largest is Mechanism.SPRING_BACK and sprung_back:
        # The spring-back grows with the force; the wall's deflection does not.
        matching = loss_n + at_speed_n * (measured + sprung_um - um_pp) / sprung_um
    return CutError(
        z_mm=middle_mm(job),
        um_pp=um_pp,
        mechanism=largest,
        spring_back_um_pp=sprung_um,
        amplitude_um=abs(wave),
        phase_deg=phase_deg if um_pp >= LEAST_SEEN_UM else None,
        sd_um_pp=sprung_um * part.holding.force_sd_fraction * job.chucking_force_n / at_speed_n,
        measured_um_pp=measured,
        diagnosis=seen,
        matching_force_n=matching,
    )


def scaled_cut(cut: CutError, factor: float, phase_deg: float) -> CutError:
    """Return the error scaled to the lobe that was found, and its angle; no force belongs to it."""
    um_pp = factor * cut.um_pp
    return replace(
        cut,
        um_pp=um_pp,
        spring_back_um_pp=factor * cut.spring_back_um_pp,
        amplitude_um=factor * cut.amplitude_um,
        phase_deg=phase_deg if um_pp >= LEAST_SEEN_UM else None,
        sd_um_pp=factor * cut.sd_um_pp,
        matching_force_n=None,
    )
