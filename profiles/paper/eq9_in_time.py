"""Eq 9 after a step, by its residues: x(t) = sum N(p) exp(p t) / D'(p) over the poles p of D.

D = M s^3 + (B + K Kd) s^2 + K Kp s + K Ki, K = Ka Kt.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from profiles.axis.servo_gains import eq9_gains
from profiles.machine import MachineProfile


def step_error(machine: MachineProfile, time_s: float) -> float:
    """Return the remaining error of a step command at a time after it: N = M s^2 + B s."""
    tool = machine.tool
    return _sum(machine, [tool.moving_mass_kg, tool.damping_n_s_per_m, 0.0], time_s)


def pushed_um_per_n(machine: MachineProfile, time_s: float) -> float:
    """Return the displacement by a step of force at a time after it, um/N: N = 1."""
    return 1e6 * _sum(machine, [1.0], time_s)


def _sum(machine: MachineProfile, numerator: ArrayLike, time_s: float) -> float:
    tool, gains = machine.tool, eq9_gains(machine)
    gain = tool.loop_gain_n_per_v
    denominator = [
        tool.moving_mass_kg,
        tool.damping_n_s_per_m + gain * gains.kd_v_s_per_m,
        gain * gains.kp_v_per_m,
        gain * gains.ki_v_per_m_s,
    ]
    poles = np.roots(denominator)
    residues = np.polyval(np.asarray(numerator), poles) / np.polyval(np.polyder(denominator), poles)
    return float(np.real(np.sum(residues * np.exp(poles * time_s))))
