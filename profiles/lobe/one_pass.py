"""The effect of one pass on the part: how the lobe changes with the wall, and the width of cut without chatter."""

from __future__ import annotations

from profiles.chucking.held_part import HeldPart, held_part
from profiles.cutting import chatter_limit_mm as limit_mm
from profiles.cutting import radial_cutting_stiffness_n_per_mm2
from profiles.job import Job
from profiles.lobe.lobe_conditions import found_on_a_part
from profiles.lobe.lobe_scale import lobe_scale, middle_mm
from profiles.machine import MachineProfile


def chatter_limit_mm(job: Job, machine: MachineProfile) -> float:
    """Return the width of cut below which the part of a job does not chatter. Fast enough for every key.

    Raises `ProfileError` (`rule.material_unknown`).
    """
    return width_without_chatter_mm(held_part(job, machine))


def lobe_change_um(job: Job, machine: MachineProfile) -> float | None:
    """Return the change of the lobe in the middle of the cut by one pass, um p-p, at the same force.

    Scaled to the lobe that was found, if any; None where the model has no such lobe for comparison.
    Raises `ProfileError` (`rule.material_unknown`).
    """
    return _change_um(held_part(job, machine), machine)


def width_without_chatter_mm(part: HeldPart) -> float:
    """Return the width of cut below which a part does not chatter at its point of least stiffness."""
    radial = radial_cutting_stiffness_n_per_mm2(part.material, part.job.feed_mm_per_rev)
    return limit_mm(part.softest_n_per_um, part.damping_ratio, radial)


def _change_um(part: HeldPart, machine: MachineProfile) -> float | None:
    """Return the change: at the same force a thinner wall springs back further, p-p ~ R^3 / t^3.

    Far from the jaws, where the lobe decays and changes its sign, it may also become smaller. A compensation of
    the previous pass is wrong by the change either way. The contacts of a bar do not depend on its thickness.
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
