"""The motion that dry friction takes from a tool: by its describing function, through the sampled loop.

Friction of the force F opposes the speed, a square wave: 4 F / (pi k) at each odd multiple k of the lobe frequency
(describing function of a relay, Gelb and Vander Velde 1968). Each acts through the loop like any other force on
the tool, independent of the command, so inverting the tool's response neither adds to it nor reduces it.
"""

from __future__ import annotations

import math

import numpy as np

from profiles.axis.sampled_loop import loop_of
from profiles.axis.stiffness import compliance_um_per_n
from profiles.job import Job
from profiles.machine import MachineProfile

ASSUMED_FRICTION_N = 5.0  # assumed dry friction of an unmeasured tool: roller guides of its size have 2 to 5 N
USUAL_FRICTION_N = 3.5  # the middle of those
HARMONICS = (1, 3, 5)
"""Multiples of the lobe that count: the fifth has a hundredth of the first, as only the mass resists it."""


def friction_um_pp(
    machine: MachineProfile, lobe_frequency_hz: float, friction_n: float, path_um_pp: float
) -> float:
    """Return the most that dry friction leaves of a lobed path, um p-p: the sum of 8 F / (pi k) |G_d(k f)|.

    A sticking tool leaves all of its path and no more. Part of the friction is already in the profile's
    damping, which the inverse corrects; this is not subtracted: 9 % at 27.5 um and 50 Hz.
    """
    multiples = np.array(HARMONICS, dtype=np.float64)
    found = compliance_um_per_n(loop_of(machine), machine.tool.loop_gain_n_per_v, multiples * lobe_frequency_hz)
    return min(float(np.sum(8.0 * friction_n / (math.pi * multiples) * np.abs(found))), path_um_pp)


def held_back_um(machine: MachineProfile, job: Job, order: int) -> float:
    """Return how much friction may hold the tool back at this order (UPR), um of amplitude.

    (4/(k pi)) F |G_d| at k times the lobe, with the highest friction of roller guides; 0 at orders that are no
    odd multiple of the lobe, which friction does not excite.
    """
    multiple, rest = divmod(order, job.jaws)
    if rest or multiple % 2 == 0:
        return 0.0
    frequency_hz, thrust = order * job.spindle_speed_rpm / 60.0, machine.tool.loop_gain_n_per_v
    compliance = complex(compliance_um_per_n(loop_of(machine), thrust, frequency_hz))
    return 4.0 * ASSUMED_FRICTION_N / (math.pi * multiple) * abs(compliance)
