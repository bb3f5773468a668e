"""The compliance of the tool axis under a cutting force: the other input of Eq 9."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, complexes, floats
from profiles.axis.servo_gains import eq9_gains
from profiles.machine import MachineProfile


def tool_compliance_um_per_n(machine: MachineProfile, frequency_hz: ArrayLike) -> Complexes:
    """Return G_d = s / (M s^3 + (B + K Kd) s^2 + K Kp s + K Ki), K = Ka Kt, in um/N, for each frequency.

    From a force that pushes the tool out to its displacement; a lag is a negative phase. Without an integrator
    the value at 0 Hz is 1 / (K Kp), with one it is 0, reached after some time constants Kp / Ki.
    """
    tool, gains = machine.tool, eq9_gains(machine)
    gain = tool.loop_gain_n_per_v
    s = 2j * np.pi * floats(frequency_hz)
    spring = gain * gains.kp_v_per_m + (tool.damping_n_s_per_m + gain * gains.kd_v_s_per_m) * s
    spring = spring + tool.moving_mass_kg * s**2
    if gains.ki_v_per_m_s == 0:
        return complexes(1e6 / spring)
    return complexes(1e6 * s / (s * spring + gain * gains.ki_v_per_m_s))
