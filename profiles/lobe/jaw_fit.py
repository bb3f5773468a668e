"""How the jaws of a chuck hold, from sections of a part that was cut without compensation.

A lobe of order N has along Z, um of amplitude, positive where the part is high at the jaws,

a(z) = p S(z) + q E(z)

with S of straight jaws and E of even pressure, by the model of the job, whose shape along Z the compensation has,
too. Weighted least squares find p and q; p / (p + q) is the fraction of the force as of straight jaws, and the
height is free. The standard uncertainty is that of the sections' amplitudes, at least `LEAST_SD_UM`, and of
their scatter where more than two sections scatter by more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import floats
from profiles.chucking.held_part import held_part
from profiles.job import Job
from profiles.lobe.along import along_um
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile
from profiles.problem import refusal_error

LEAST_SD_UM = 0.1  # of an amplitude: a height that is off by 0.1 mm makes as much of a lobe of 30 um; assumed
LEAST_OF_STATED = 0.25  # of the job's lobe at mid-cut, on a plain part: a compensation leaves less; a choice
MOST_SD = 0.15  # of a fraction that is worth keeping: that of the profiles is a guess to about a quarter


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionLobe:
    """The lobe of one section, c of Re(c exp(j N angle)) in um, and the standard error of its amplitude.

    `z_mm` is from the jaw faces; the angles of all sections begin at one place.
    """

    z_mm: float
    lobe_um: complex
    sd_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightFit:
    """The fraction of the force as of straight jaws, with its standard uncertainty.

    `left_um` is the largest difference of a section from the fit, 0 of two sections.
    """

    fraction: float
    sd: float
    sections: int
    lowest_mm: float
    highest_mm: float
    left_um: float


def fit_straight_fraction(job: Job, machine: MachineProfile, sections: Sequence[SectionLobe]) -> StraightFit:
    """Return how the jaws of a machine hold the part of a job.

    Raises `ProfileError`: `jaws.height`, a section that is not within the cut; `jaws.undetermined`, sections that
    leave the fraction open by more than `MOST_SD`, or a part that does not bend; `jaws.compensated`, a lobe too
    small for a plain part; `jaws.outside`, a fraction that no jaws have; `rule.material_unknown`.
    """
    part, key = held_part(job, machine), "jaw_straight_fraction"
    z_mm = floats([each.z_mm for each in sections])
    begin_mm, end_mm = job.overhang_mm - job.cut_length_mm, job.overhang_mm
    for each in z_mm[(z_mm < begin_mm) | (z_mm > end_mm)][:1]:
        limit = f"{begin_mm:g} … {end_mm:g} mm"
        raise refusal_error("jaws.height", key="z_mm", value=f"{each:g} mm", limit=limit)
    heights = f"Z {', '.join(f'{each:g}' for each in np.unique(z_mm))} mm"
    if not part.thin or len(np.unique(z_mm)) < 2:
        raise refusal_error("jaws.undetermined", key=key, value=heights, limit=f"± {MOST_SD:g}")
    lobes = np.array([each.lobe_um for each in sections])
    axis = lobes[np.abs(lobes).argmax()]
    ways = (replace(part, holding=replace(part.holding, straight_fraction=fraction)) for fraction in (1.0, 0.0))
    places = (*z_mm.tolist(), middle_mm(job))
    *rows, middle = np.stack([along_um(each, places)[0] for each in ways], axis=1)
    columns = np.array(rows)
    # Where the lobe is largest the part is high at the jaws, unless the model has it low there.
    along = (lobes * axis.conjugate()).real / abs(axis) * np.sign(columns[np.abs(lobes).argmax()].sum())
    weights = 1.0 / floats([max(each.sd_um, LEAST_SD_UM) for each in sections])
    cofactors = np.linalg.pinv((columns * weights[:, None]).T @ (columns * weights[:, None]))
    p, q = cofactors @ (columns * weights[:, None] ** 2).T @ along
    left = along - columns @ (p, q)
    freedom = len(sections) - 2
    scatter = float(np.sum((weights * left) ** 2)) / freedom if freedom else 1.0
    by = np.array([q, -p]) / (p + q) ** 2
    fraction, sd = float(p / (p + q)), float(np.sqrt(max(scatter, 1.0) * by @ cofactors @ by))
    found = f"{fraction:.2f} ± {sd:.2g}"
    surely_outside = not -2.0 * sd <= fraction <= 1.0 + 2.0 * sd
    determined, even = sd <= MOST_SD or surely_outside, columns.sum(axis=1)
    parts = np.array([p, q]) if determined else np.full(2, even @ along / (even @ even))
    middle_um, least_um = 2.0 * float(middle @ parts), LEAST_OF_STATED * job.lobe_error_um_pp
    if middle_um < least_um:
        value, limit = f"{middle_um:.1f} um p-p", f"{least_um:.1f} um p-p"
        raise refusal_error("jaws.compensated", key="lobe_error_um_pp", value=value, limit=limit)
    if not determined:
        raise refusal_error("jaws.undetermined", key=key, value=f"{found}, {heights}", limit=f"± {MOST_SD:g}")
    if not 0.0 <= fraction <= 1.0:
        raise refusal_error("jaws.outside", key=key, value=found, limit="0 … 1")
    return StraightFit(
        fraction=fraction,
        sd=sd,
        sections=len(sections),
        lowest_mm=float(z_mm.min()),
        highest_mm=float(z_mm.max()),
        left_um=float(np.abs(left).max()) if freedom else 0.0,
    )
