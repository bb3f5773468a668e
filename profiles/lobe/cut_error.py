"""The error in the middle of a cut: its main mechanism, where it is high, and how it compares with the part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from profiles.chucking.diagnosis import Diagnosis, Mechanism, diagnose
from profiles.chucking.held_part import HeldPart
from profiles.chucking.tube import HALF_LOBE_ANGLES
from profiles.lobe.lobe_conditions import found_on_a_part
from profiles.lobe.lobe_scale import LEAST_SEEN_UM, middle_mm

_ANGLES = 2 * (HALF_LOBE_ANGLES - 1)
"""Over one lobe: those of `HeldPart.error_um_pp`, and their mirror images."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutError:
    """The error of the released part `z_mm` in front of the jaws.

    `mechanism` is its main cause, `spring_back_um_pp` that contribution alone. `amplitude_um` and `crest_deg`
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
    crest_deg: float | None
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
    crest_deg = job.jaw_1_deg - float(np.degrees(np.angle(wave))) / jaws
    largest = max(parts, key=lambda which: float(np.ptp(parts[which])))
    at_speed_n = part.per_jaw_n * jaws
    measured = job.lobe_error_um_pp if found_on_a_part(job) else None
    seen = _diagnosis(part) if measured else None
    matching = None
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
        crest_deg=crest_deg if um_pp >= LEAST_SEEN_UM else None,
        sd_um_pp=sprung_um * part.holding.force_sd_share * job.chucking_force_n / at_speed_n,
        measured_um_pp=measured,
        diagnosis=seen,
        matching_force_n=matching,
    )


def scaled_cut(cut: CutError, factor: float, crest_deg: float) -> CutError:
    """Return the error scaled to the lobe that was found, and its angle; no force belongs to it."""
    um_pp = factor * cut.um_pp
    return replace(
        cut,
        um_pp=um_pp,
        spring_back_um_pp=factor * cut.spring_back_um_pp,
        amplitude_um=factor * cut.amplitude_um,
        crest_deg=crest_deg if um_pp >= LEAST_SEEN_UM else None,
        sd_um_pp=factor * cut.sd_um_pp,
        matching_force_n=None,
    )


def _diagnosis(part: HeldPart) -> Diagnosis | None:
    past_deg = part.job.lobe_past_jaw_deg
    return (
        None
        if past_deg is None
        else diagnose(crest_deg=past_deg, jaw_1_deg=0.0, jaws=part.job.jaws, thin=part.thin)
    )
