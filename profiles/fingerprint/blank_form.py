"""The oval of the blank itself, and how much of it the cut copies to the part.

The difference of the two readings has none of it, but the finger-tight reading has, with the error of the spindle
and what finger-tight itself presses, both small beside it. An uneven blank swings the depth of cut, and so the
force: tool and part give way by that much less or more. As springs in series a cut of the stiffness k copies the
fraction c k / (1 + c k), with c the compliance of both twice a turn. What the tool has of it a trimmed cut removes
from the motion that it sees; the rest, of the part, is seen by nothing before the part is measured.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from profiles.arrays import floats
from profiles.axis.servo import tool_compliance_um_per_n
from profiles.chucking.held_part import held_part
from profiles.compensations.learning import SURE
from profiles.compensations.path import PathHarmonic
from profiles.cutting import copying
from profiles.fingerprint.deflection import ONCE, OVAL, STEADY, reading_sd_um, spindle_rad
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.least_squares import fit, harmonic_columns, phasors
from profiles.machine import MachineProfile
from profiles.problem import ProfileError


@dataclass(frozen=True, slots=True, kw_only=True)
class BlankOval:
    """The oval of a blank: `wave` is outwards, in spindle angle, `limit_um` the 95 % half-width of its amplitude.

    `copied` is the fraction of it that the cut leaves on the part by the model, `copied_by_part` that with a tool
    that does not give way; both None of a material without data.
    """

    wave: PathHarmonic
    limit_um: float
    copied: float | None = None
    copied_by_part: float | None = None


def blank_oval(readings: ClampReadings, job: Job, machine: MachineProfile) -> BlankOval | None:
    """Return the oval that the finger-tight readings show; `job` has jaw 1 where it is.

    None where it cannot be told from the lobe: with two jaws, and at too few places.
    """
    orders = (ONCE, OVAL, job.jaws)
    columns = harmonic_columns(spindle_rad(readings, job), orders)
    if job.jaws == OVAL or columns.shape[1] > readings.places:
        return None
    found = fit(columns, (-1.0 if readings.inward else 1.0) * floats(readings.finger_um))
    if found.condition > STEADY:
        return None
    sd_um, _ = reading_sd_um(readings, found.residuals, found.freedom)
    oval = BlankOval(
        wave=PathHarmonic.from_coefficient(OVAL, phasors(found.coefficients, orders)[OVAL]),
        limit_um=SURE * sd_um * float(found.cofactors[3:5, 3:5].trace() / 2.0) ** 0.5,
    )
    try:
        part = held_part(job, machine)
    except ProfileError:
        return oval
    cut_n_per_um = part.force.passive_n / (1000.0 * job.depth_of_cut_mm)
    of_tool = abs(complex(tool_compliance_um_per_n(machine, OVAL * job.spindle_speed_rpm / 60.0)))
    of_both, of_part = (
        copying(cut_n_per_um, 1.0 / c).fraction_left()
        for c in (of_tool + part.compliance_um_per_n, part.compliance_um_per_n)
    )
    return replace(oval, copied=of_both, copied_by_part=of_part)
