"""How far a force pushes the tool while its loop is closed: dynamic compliance, in um/N, of the loop that runs.

A force on the tool acts on the plant like the output of the controller, without hold and period:

G_d = (a / K) / (s (s + b)) / (1 + L),    K the thrust for one volt

Its inverse is the dynamic stiffness. Modes of the plant are in L; their own yielding under the force is left out.

Friction of the force F opposes the speed, a square wave: 4 F / (pi k) at each odd multiple k of the lobe frequency
(describing function of a relay, Gelb and Vander Velde 1968). Each acts through the loop like any other force on
the tool, independent of the command, so inverting the response of the tool neither adds to it nor reduces it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, complexes, floats
from profiles.axis.sampled_loop import SampledLoop, loop_of
from profiles.job import Job
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
