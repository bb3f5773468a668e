"""How far the cut pushes the tool along the part, found from the tool's own scale in a cut.

The cut pushes the tool by x at its entry, and the integrator brings it back: x exp(-t / T). The less deep it cuts
meanwhile, the less it is pushed: of a force that falls by k for each um, on a loop that yields by c for each
newton, x = c F / (1 + c k) and T = T_i (1 + c k), with T_i that of the integrator. Once the path makes up for the
push the tool stays at its depth, and is pushed by c F.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.axis.stiffness import push_um_per_n, relaxation_ms
from profiles.compensations.learning import SURE
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.least_squares import fit
from profiles.machine import MachineProfile
from profiles.materials import material_or_none

LEAST_BATCHES = 6
LEAST_DECAYS = 0.4  # fraction of a decay that a cut has to be long: in less a slope looks the same, and is far off
BATCHES_A_DECAY = 4  # fewer in the time of one decay do not show it; the loop is stiff then, and needs nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """What the path does not make up for yet, um: of the push at the entry, and of its rest in the middle."""

    um: float = 0.0
    in_middle_um: float = 0.0


NO_PUSH = Push()


def predicted_push_um(job: Job, machine: MachineProfile) -> float:
    """Return the push of the predicted cut, by what the machine states of its force; 0 where that is unknown."""
    material, fraction = material_or_none(job.material), machine.tool.passive_force_fraction
    if material is None or not fraction:
        return 0.0
    force = cutting_force(material, job.depth_of_cut_mm, job.feed_mm_per_rev, passive_fraction=fraction)
    return force.passive_n * push_um_per_n(machine)


def given_back(job: Job, machine: MachineProfile) -> float:
    """Return c k, the fraction of a push that the cut gives back as it is less deep; 0 where it is unknown."""
    material = material_or_none(job.material)
    if material is None:
        return 0.0
    per_um = cutting_force(material, 0.001, job.feed_mm_per_rev).passive_n
    return per_um * push_um_per_n(machine)


def decay_mm(job: Job, machine: MachineProfile) -> float:
    """Return the length along Z in which 63 % of a push is gone; infinite without an integrator."""
    feed_mm_per_ms = job.feed_mm_per_rev * job.spindle_speed_rpm / 60_000.0
    return feed_mm_per_ms * relaxation_ms(machine) * (1.0 + given_back(job, machine))


def left_along_um(push_um: float, job: Job, machine: MachineProfile, past_middle_mm: ArrayLike) -> Floats:
    """Return by how much the tool is not in far enough along a cut that has so much push left, um."""
    half_mm = _half_mm(job, machine)
    shown_um = push_um / (1.0 + given_back(job, machine))
    return floats(shown_um * np.exp(-(floats(past_middle_mm) + half_mm) / decay_mm(job, machine)))


def _half_mm(job: Job, machine: MachineProfile) -> float:
    """Return the way from the first contact to the middle of the cut."""
    return 0.5 * (job.cut_length_mm + machine.tool.wiper_land_mm)


def entry_push_um(
    job: Job, machine: MachineProfile, past_middle_mm: Sequence[float], error_um: Sequence[float]
) -> float:
    """Return the push of a cut too short to show its decay: the tool is taken to be on its path without it.

    Once the path makes up for it the tool stays at its depth; so it is that of the whole force.
    """
    decayed = np.exp(-(floats(past_middle_mm) + _half_mm(job, machine)) / decay_mm(job, machine))
    return float(decayed @ floats(error_um) / (decayed @ decayed)) * (1.0 + given_back(job, machine))


def left_push(
    job: Job, machine: MachineProfile, past_middle_mm: Sequence[float], error_um: Sequence[float]
) -> Push:
    """Return the push that the tool has shown in a cut: its mean errors, positive where it was not in far enough.

    None is found in few batches, none that does not stand out of their scatter, and none of a stiff loop.
    """
    decay, at_mm = decay_mm(job, machine), floats(past_middle_mm)
    if len(at_mm) < LEAST_BATCHES or float(np.ptp(at_mm)) < LEAST_DECAYS * decay:
        return NO_PUSH
    if decay * len(at_mm) < BATCHES_A_DECAY * float(np.ptp(at_mm)):
        return NO_PUSH
    half_mm = _half_mm(job, machine)
    found = fit(np.column_stack([np.ones_like(at_mm), np.exp(-(at_mm + half_mm) / decay)]), floats(error_um))
    shown_um = float(found.coefficients[1])
    if abs(shown_um) <= SURE * found.sd_along(floats([0.0, 1.0])):
        return NO_PUSH
    in_middle_um = shown_um * float(np.exp(-half_mm / decay))
    return Push(um=shown_um * (1.0 + given_back(job, machine)), in_middle_um=in_middle_um)
