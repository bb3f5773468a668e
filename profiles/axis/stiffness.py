"""How far a force pushes the tool while its loop is closed: dynamic compliance, in um/N, of the loop that runs.

A force on the tool acts on the plant like the output of the controller, without hold and period:

G_d = (a / K) / (s (s + b)) / (1 + L),    K the thrust for one volt

Its inverse is the dynamic stiffness. Modes of the plant are in L; their own yielding under the force is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, complexes, floats
from profiles.axis.sampled_loop import SampledLoop
from profiles.machine import MachineProfile

LOBE_MULTIPLES = (1, 2, 3)
_LOWEST_HZ, _POINTS = 0.1, 600


def relaxation_ms(machine: MachineProfile) -> float:
    """Return the time constant with which the integrator takes over a steady force; infinite without one."""
    tool = machine.tool
    ki = tool.gain_ki_v_per_m_s
    return 1000.0 * tool.gain_kp_v_per_m / ki if ki else math.inf


def push_um_per_n(machine: MachineProfile) -> float:
    """Return how far a steady force pushes the tool before the integrator takes it over."""
    tool = machine.tool
    return 1e6 / (tool.gain_kp_v_per_m * tool.thrust_constant_n_per_a * tool.amplifier_gain_a_per_v)


@dataclass(frozen=True, slots=True, kw_only=True)
class LobeStiffness:
    """The compliance at multiples of a lobe frequency, and the largest at any frequency."""

    hz: tuple[float, ...]
    um_per_n: tuple[float, ...]
    most_um_per_n: float
    most_hz: float


def tripping_friction_n(stiffness: LobeStiffness, error_limit_um: float) -> float:
    """Return the dry friction that trips the following-error limit on reversal: the loop yields to it twice."""
    return error_limit_um / (2.0 * stiffness.most_um_per_n)


def compliance_um_per_n(loop: SampledLoop, thrust_n_per_v: float, frequency_hz: ArrayLike) -> Complexes:
    """Return G_d at these frequencies, above 0 and below half the sampling rate; a lag is a negative phase."""
    hz = floats(frequency_hz)
    s, plant = 2j * np.pi * hz, loop.plant
    free = plant.acceleration_per_v / thrust_n_per_v / (s * (s + plant.damping_per_s))
    return complexes(1e6 * free / (1.0 + loop.open_loop(hz)))


def lobe_stiffness(loop: SampledLoop, thrust_n_per_v: float, lobe_hz: float) -> LobeStiffness:
    """Return the compliance at the lobe and its multiples, as far as the loop has a response there."""
    hz = tuple(n * lobe_hz for n in LOBE_MULTIPLES if n * lobe_hz < loop.nyquist_hz)
    grid = floats(np.geomspace(_LOWEST_HZ, loop.nyquist_hz, _POINTS))
    around = np.abs(compliance_um_per_n(loop, thrust_n_per_v, grid))
    place = int(np.argmax(around))
    return LobeStiffness(
        hz=hz,
        um_per_n=tuple(np.abs(compliance_um_per_n(loop, thrust_n_per_v, hz)).tolist()),
        most_um_per_n=float(around[place]),
        most_hz=float(grid[place]),
    )
