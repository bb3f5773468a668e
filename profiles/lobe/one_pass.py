"""What one pass does to the part: how the lobe changes with the wall, and how wide a cut it bears."""

from __future__ import annotations

from profiles.chucking.held_part import HeldPart
from profiles.cutting import chatter_limit_mm as limit_mm
from profiles.cutting import radial_cutting_stiffness_n_per_mm2
from profiles.job import Job
from profiles.lobe.held_job import held_part
from profiles.lobe.lobe_conditions import found_on_a_part
from profiles.lobe.lobe_scale import lobe_scale, middle_mm
from profiles.machine import MachineProfile


def chatter_limit_mm(job: Job, machine: MachineProfile) -> float:
    """Return the width of cut below which the part of a job does not chatter. Cheap enough for every key.

    Raises:
        ProfileError: `rule.material_unknown`.
    """
    return width_without_chatter_mm(held_part(job, machine))


def lobe_change_um(job: Job, machine: MachineProfile) -> float | None:
    """Return by how much the lobe in the middle of the cut grows with one pass, um p-p, at the same force.

    It is that of the lobe that was found, where one was; None where the model has no such lobe to judge it by.

    Raises:
        ProfileError: `rule.material_unknown`.
    """
    return _change_um(held_part(job, machine), machine)


def width_without_chatter_mm(part: HeldPart) -> float:
    """Return the width of cut below which a part does not chatter, where it is softest."""
    radial = radial_cutting_stiffness_n_per_mm2(part.material, part.job.feed_mm_per_rev)
    return limit_mm(part.softest_n_per_um, part.damping_ratio, radial)


def _change_um(part: HeldPart, machine: MachineProfile) -> float | None:
    """At the same force a thinner wall springs back further, p-p ~ R^3 / t^3.

    Far from the jaws, where the lobe dies away and changes its sign, it may also become smaller. A compensation of
    the pass before is wrong by the change either way. The contacts of a bar do not know how thick it is.
    """
    job, after = part.job, part.turned_down(part.job.depth_of_cut_mm)
    factor = 1.0
    if found_on_a_part(job):
        scale = lobe_scale(job, machine)
        if scale is None:
            return None
        factor = scale.factor
    if not part.thin and not after.thin:
        return 0.0
    return factor * (after.error_um_pp(middle_mm(after.job)) - part.error_um_pp(middle_mm(job)))
