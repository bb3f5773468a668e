"""The tool axis as a servo: Eq 9, the loop as sampled by the controller, its stiffness, and the load of a sine.

Lengths are in m, voltages are those of the controller's output. Every response is complex, from commanded to
actual position, at frequencies in Hz; a lag is a negative phase. The gains of the controller and those of
Eq 9 are converted into each other, so that the inverse which is commanded is that of the loop which runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import PidGains, eq9_gains
from profiles.machine import MachineProfile

_HALF_POWER_DB = 20 * math.log10(1 / math.sqrt(2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Eq9Summary:
    """Figures of the continuous closed loop (section 4.2 of the paper claims about 80 Hz and below 5 %)."""

    bandwidth_hz: float
    peak: float
    peak_hz: float
    overshoot_percent: float
    crossover_hz: float
    phase_margin_deg: float
    gain_margin: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveNeed:
    """What a sine requires of motor and amplifier; peak values, and the mean copper loss."""

    velocity_mm_per_s: float
    acceleration_m_per_s2: float
    force_n: float
    current_a: float
    voltage_v: float
    copper_loss_w: float


def eq9_response(machine: MachineProfile, frequency_hz: ArrayLike) -> Complexes:
    """Return Eq 9, C Ka Kt / (M s^2 + B s + C Ka Kt), in the shape of `frequency_hz`.

    C = Kp + Ki/s + Kd s. At 0 Hz the value is 1.
    """
    numerator, denominator = _eq9_polynomials(machine)
    s = 2j * np.pi * floats(frequency_hz)
    return complexes(np.polyval(numerator, s) / np.polyval(denominator, s))


def eq9_summary(machine: MachineProfile) -> Eq9Summary:
    """Return bandwidth (half power), resonance peak, step overshoot and margins of Eq 9."""
    numerator, denominator = _eq9_polynomials(machine)
    return _summary(tuple(numerator), tuple(denominator))


@lru_cache(maxsize=16)  # it depends on the tool alone, and is needed for every job on it
def _summary(numerator: tuple[float, ...], denominator: tuple[float, ...]) -> Eq9Summary:
    import control

    closed = control.TransferFunction(list(numerator), list(denominator))
    opened = control.TransferFunction(list(numerator), np.polysub(denominator, numerator))
    gain_margin, phase_margin, _, crossover = control.margin(opened)
    bandwidth_hz = float(control.bandwidth(closed, dbdrop=_HALF_POWER_DB)) / (2 * math.pi)
    frequencies = np.linspace(0, 4 * bandwidth_hz, 20_001)
    s = 2j * np.pi * frequencies
    magnitudes = np.abs(np.polyval(numerator, s) / np.polyval(denominator, s))
    time_s = np.linspace(0, 10 / bandwidth_hz, 20_001)
    step = control.step_response(closed, time_s).outputs
    return Eq9Summary(
        bandwidth_hz=bandwidth_hz,
        peak=float(magnitudes.max()),
        peak_hz=float(frequencies[magnitudes.argmax()]),
        overshoot_percent=100 * (float(np.max(step)) - 1),
        crossover_hz=float(crossover) / (2 * math.pi),
        phase_margin_deg=float(phase_margin),
        gain_margin=float(gain_margin),
    )


def sampled_response(machine: MachineProfile, frequency_hz: ArrayLike, gains: PidGains | None = None) -> Complexes:
    """Return the response of the sampled loop, in the shape of `frequency_hz` (above 0, below Nyquist).

    It is that of `profiles.axis.sampled_loop`; without `gains` they are those of the controller's variables. At
    0 Hz the value is 1.
    """
    loop = loop_of(machine)
    return (loop if gains is None else replace(loop, gains=gains)).closed_loop(frequency_hz)


def tool_compliance_um_per_n(machine: MachineProfile, frequency_hz: ArrayLike) -> Complexes:
    """Return G_d = s / (M s^3 + (B + K Kd) s^2 + K Kp s + K Ki), K = Ka Kt, in um/N, for each frequency.

    The other input of Eq 9: from a force that pushes the tool out to its displacement. Without an integrator the
    value at 0 Hz is 1 / (K Kp), with one it is 0, reached after some time constants Kp / Ki.
    """
    tool, gains = machine.tool, eq9_gains(machine)
    gain = tool.loop_gain_n_per_v
    s = 2j * np.pi * floats(frequency_hz)
    spring = gain * gains.kp_v_per_m + (tool.damping_n_s_per_m + gain * gains.kd_v_s_per_m) * s
    spring = spring + tool.moving_mass_kg * s**2
    if gains.ki_v_per_m_s == 0:
        return complexes(1e6 / spring)
    return complexes(1e6 * s / (s * spring + gain * gains.ki_v_per_m_s))


def step_error(machine: MachineProfile, time_s: float) -> float:
    """Return the remaining error of a step command of Eq 9 at a time after it: N = M s^2 + B s."""
    return float(_after_step(machine, [machine.tool.moving_mass_kg, machine.tool.damping_n_s_per_m, 0.0], time_s))


def pushed_um_per_n(machine: MachineProfile, time_s: ArrayLike) -> Floats:
    """Return the displacement by a step of force at times after it, um/N, in the shape of `time_s`: N = 1."""
    return 1e6 * _after_step(machine, [1.0], time_s)


def _after_step(machine: MachineProfile, numerator: ArrayLike, time_s: ArrayLike) -> Floats:
    """Return sum N(p) exp(p t) / D'(p) over the poles p of Eq 9, the roots of its denominator D."""
    _, denominator = _eq9_polynomials(machine)
    poles = np.roots(denominator)
    residues = np.polyval(np.asarray(numerator), poles) / np.polyval(np.polyder(denominator), poles)
    return floats(np.real(np.exp(np.multiply.outer(floats(time_s), poles)) @ residues))


def following_error_um(machine: MachineProfile, amplitude_um: float, frequency_hz: float) -> float:
    """Return the peak following error of the sampled loop for a sine: A |1 - T|."""
    return amplitude_um * float(np.abs(1 - sampled_response(machine, frequency_hz)))


def drive_need(machine: MachineProfile, amplitude_um: float, frequency_hz: float) -> DriveNeed:
    """Return force, current, voltage and loss of y = A sin(w t) without a cut.

    F = (-M w^2 + j B w) A, I = F / Kt, V = (R + j w L) I + Kb j w A.
    """
    tool = machine.tool
    amplitude_m, omega = amplitude_um * 1e-6, 2 * math.pi * frequency_hz
    force = amplitude_m * complex(-tool.moving_mass_kg * omega**2, tool.damping_n_s_per_m * omega)
    current = force / tool.thrust_constant_n_per_a
    coil = complex(tool.coil_resistance_ohm, omega * tool.coil_inductance_h)
    voltage = coil * current + 1j * tool.back_emf_v_s_per_m * omega * amplitude_m
    return DriveNeed(
        velocity_mm_per_s=1000 * omega * amplitude_m,
        acceleration_m_per_s2=omega**2 * amplitude_m,
        force_n=abs(force),
        current_a=abs(current),
        voltage_v=abs(voltage),
        copper_loss_w=abs(current) ** 2 * tool.coil_resistance_ohm / 2,
    )


def _eq9_polynomials(machine: MachineProfile) -> tuple[list[float], list[float]]:
    """Return numerator and denominator of Eq 9 in falling powers of s, both multiplied by s."""
    tool, gains = machine.tool, eq9_gains(machine)
    gain = tool.loop_gain_n_per_v
    numerator = [gain * gains.kd_v_s_per_m, gain * gains.kp_v_per_m, gain * gains.ki_v_per_m_s]
    denominator = [tool.moving_mass_kg, tool.damping_n_s_per_m + numerator[0], *numerator[1:]]
    if gains.ki_v_per_m_s == 0:  # the common factor s, which would make 0 Hz undefined
        return numerator[:-1], denominator[:-1]
    return numerator, denominator
