"""The motion that dry friction takes from a tool: by its describing function, through the sampled loop.

Friction of the force F opposes the speed, a square wave: 4 F / (pi k) at each odd multiple k of the lobe frequency
(describing function of a relay, Gelb and Vander Velde 1968). Each acts through the loop like any other force on
the tool, independent of the command, so inverting the tool's response neither adds to it nor reduces it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, floats
from profiles.axis.servo import sampled_response
from profiles.axis.servo_gains import gains_from_variables
from profiles.job import Job
from profiles.machine import MachineProfile

ASSUMED_FRICTION_N = 5.0  # assumed dry friction of an unmeasured tool: roller guides of its size have 2 to 5 N
USUAL_FRICTION_N = 3.5  # the middle of those
HARMONICS = (1, 3, 5)
"""Multiples of the lobe that count: the fifth has a hundredth of the first, as only the mass resists it."""


def sampled_compliance_um_per_n(machine: MachineProfile, frequency_hz: ArrayLike) -> Complexes:
    """Return the sampled loop's compliance, um/N, in the shape of `frequency_hz`; a lag is a negative phase.

    Like `tool_compliance_um_per_n` for the sampled loop, which acts one period late: G_d = S / (M s^2 + B s) with
    its sensitivity S = 1 / (1 + L). Frequencies above 0 and far below Nyquist.
    """
    gains = gains_from_variables(machine)
    bare = replace(gains, velocity_feedforward_v_s_per_m=0.0, acceleration_feedforward_v_s2_per_m=0.0)
    tool, period_s = machine.tool, machine.controller.servo_period_ms / 1000
    s = 2j * np.pi * floats(frequency_hz)
    slope = (1 - np.exp(-s * period_s)) / period_s
    ahead = gains.kp_v_per_m + gains.ki_v_per_m_s / slope
    # Without feedforward the response is L ahead / back / (1 + L), so that S follows from it.
    sensitivity = 1 - sampled_response(machine, frequency_hz, bare) * (1 + gains.kd_v_s_per_m * slope / ahead)
    return np.asarray(1e6 * sensitivity / (tool.moving_mass_kg * s**2 + tool.damping_n_s_per_m * s))


def friction_um_pp(
    machine: MachineProfile, lobe_frequency_hz: float, friction_n: float, path_um_pp: float
) -> float:
    """Return the most that dry friction leaves of a lobed path, um p-p: the sum of 8 F / (pi k) |G_d(k f)|.

    A sticking tool leaves all of its path and no more. Part of the friction is already in the profile's
    damping, which the inverse corrects; this is not subtracted: 9 % at 27.5 um and 50 Hz.
    """
    multiples = np.array(HARMONICS, dtype=np.float64)
    compliance = np.abs(sampled_compliance_um_per_n(machine, multiples * lobe_frequency_hz))
    return min(float(np.sum(8.0 * friction_n / (math.pi * multiples) * compliance)), path_um_pp)


def held_back_um(machine: MachineProfile, job: Job, order: int) -> float:
    """Return how much friction may hold the tool back at this order (UPR), um of amplitude.

    (4/(k pi)) F |G_d| at k times the lobe, with the highest friction of roller guides; 0 at orders that are no
    odd multiple of the lobe, which friction does not excite.
    """
    multiple, rest = divmod(order, job.jaws)
    if rest or multiple % 2 == 0:
        return 0.0
    compliance = complex(sampled_compliance_um_per_n(machine, order * job.spindle_speed_rpm / 60.0))
    return 4.0 * ASSUMED_FRICTION_N / (math.pi * multiple) * abs(compliance)
