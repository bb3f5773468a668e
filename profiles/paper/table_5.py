"""Table 5: the real axis's response to a command of 50 um, its readings, and models that fit it.

The paper does not say whether its "amplitude error" is of the amplitude or of the peak-to-peak value, nor its
sign. Responses are complex, from commanded to actual position, at frequencies in Hz; a lag is a negative phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.servo import eq9_response, sampled_response
from profiles.axis.servo_gains import PidGains, eq9_gains, gains_from_variables, variables_from_gains
from profiles.machine import MachineProfile

FREQUENCIES_HZ = (10.0, 30.0, 50.0, 70.0)
AMPLITUDE_ERROR_UM = (2.7, 8.6, 5.8, 6.3)
PHASE_ERROR_RAD = (0.0, 0.126, 0.241, 0.275)
COMMAND_UM_PP = 50.0

WEIGHT = 0.03  # assumed reading error in the fits, of a gain and of a phase in rad, one standard deviation
UNKNOWNS = 2  # what is fitted: acceleration feedforward and delay


class ErrorBasis(Enum):
    """What the amplitude error is relative to, in um, and its sign."""

    LOSS_OF_AMPLITUDE = -1.0 / 25.0
    LOSS_PEAK_TO_PEAK = -1.0 / 50.0
    EXCESS_PEAK_TO_PEAK = 1.0 / 50.0
    EXCESS_OF_AMPLITUDE = 1.0 / 25.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Feedforward:
    """Eq 9 with a fraction of full acceleration feedforward and a delay of its output, and the quality of the fit.

    `chi2` is the sum over gains and phases of (misfit / `WEIGHT`)^2: eight data, two unknowns.
    """

    acceleration_fraction: float
    delay_s: float
    chi2: float


def measured_gains(reading: ErrorBasis = ErrorBasis.LOSS_PEAK_TO_PEAK) -> Floats:
    """Return |T| at `FREQUENCIES_HZ`; loss of peak to peak is the reading that a simple loop can produce."""
    return floats(1.0 + reading.value * np.array(AMPLITUDE_ERROR_UM))


def measured_response(frequency_hz: ArrayLike, reading: ErrorBasis = ErrorBasis.LOSS_PEAK_TO_PEAK) -> Complexes:
    """Return T of Table 5 in the shape of `frequency_hz`: straight lines from 1 at 0 Hz through the points.

    Above 70 Hz, where nothing was measured, gain and lag are taken to fall with 1/f.
    """
    frequency = floats(frequency_hz)
    known_hz = (0.0, *FREQUENCIES_HZ)
    gain = np.interp(frequency, known_hz, [1.0, *measured_gains(reading)])
    lag = np.interp(frequency, known_hz, [0.0, *PHASE_ERROR_RAD])
    fall = known_hz[-1] / np.maximum(frequency, known_hz[-1])
    return complexes(gain * fall * np.exp(-1j * lag * fall))


def pure_delay_s() -> tuple[float, float]:
    """Return the delay that fits the phases best, and its misfit, rms in rad."""
    omega, lag = 2 * np.pi * np.array(FREQUENCIES_HZ), np.array(PHASE_ERROR_RAD)
    delay_s = float(omega @ lag / (omega @ omega))
    return delay_s, float(np.sqrt(np.mean((lag - omega * delay_s) ** 2)))


def feedforward_response(
    machine: MachineProfile, frequency_hz: ArrayLike, acceleration_fraction: float, delay_s: float
) -> Complexes:
    """Return (K C + a M s^2) exp(-s d) / (M s^2 + B s + K C): Eq 9 with acceleration feedforward, delayed."""
    s = 2j * np.pi * floats(frequency_hz)
    tool, gains = machine.tool, eq9_gains(machine)
    control = gains.kp_v_per_m + gains.ki_v_per_m_s / s + gains.kd_v_s_per_m * s
    added = acceleration_fraction * tool.moving_mass_kg * s**2 / (tool.loop_gain_n_per_v * control)
    return complexes(eq9_response(machine, frequency_hz) * (1 + added) * np.exp(-s * delay_s))


def fitted_feedforward(machine: MachineProfile, reading: ErrorBasis = ErrorBasis.LOSS_PEAK_TO_PEAK) -> Feedforward:
    """Return the least squares fit of acceleration feedforward and delay to Table 5."""
    from scipy.optimize import least_squares

    def misfit(unknowns: Floats) -> Floats:
        actual = feedforward_response(machine, FREQUENCIES_HZ, unknowns[0], unknowns[1] / 1000.0)
        return _misfit(actual, reading)

    found = least_squares(misfit, (0.5, 0.5), xtol=1e-12)
    fraction, delay_ms = (float(each) for each in found.x)
    return Feedforward(acceleration_fraction=fraction, delay_s=delay_ms / 1000.0, chi2=float(2.0 * found.cost))


def fitted_gain(machine: MachineProfile) -> float:
    """Return the factor on the loop gain of Eq 9, and on nothing else, that fits Table 5 best."""
    from scipy.optimize import minimize_scalar

    def chi2(factor: float) -> float:
        tool = replace(machine.tool, amplifier_gain_a_per_v=factor * machine.tool.amplifier_gain_a_per_v)
        off = _misfit(eq9_response(replace(machine, tool=tool), FREQUENCIES_HZ), ErrorBasis.LOSS_PEAK_TO_PEAK)
        return float(off @ off)

    return float(minimize_scalar(chi2, bounds=(0.1, 20.0), method="bounded").x)


def _misfit(actual: Complexes, reading: ErrorBasis) -> Floats:
    """Return the misfit of a response in gain and phase, in weights; shape (8,)."""
    off = np.concatenate([np.abs(actual) - measured_gains(reading), np.angle(actual) + PHASE_ERROR_RAD])
    return floats(off / WEIGHT)


def misfit_of_eq9(machine: MachineProfile) -> float:
    """Return the rms in rad by which Eq 9 as printed misses the phases of Table 5."""
    off = np.angle(eq9_response(machine, FREQUENCIES_HZ)) + PHASE_ERROR_RAD
    return float(np.sqrt(np.mean(off**2)))


def with_measured_servo(machine: MachineProfile, frequency_hz: float) -> MachineProfile:
    """Return the machine with Ix32 and Ix35 of its tool at which its sampled loop has Table 5's response there.

    T is linear in both feedforward gains, so that two of them meet one complex number exactly, up to the whole
    numbers that the controller takes. At other frequencies it is another loop than the paper's.
    """
    gains = gains_from_variables(machine)

    def with_feedforward(velocity: float, acceleration: float) -> PidGains:
        return replace(
            gains, velocity_feedforward_v_s_per_m=velocity, acceleration_feedforward_v_s2_per_m=acceleration
        )

    def at(velocity: float, acceleration: float) -> complex:
        return complex(sampled_response(machine, frequency_hz, with_feedforward(velocity, acceleration)))

    without = at(0.0, 0.0)
    by_velocity, by_acceleration = at(1.0, 0.0) - without, at(0.0, 1.0) - without
    missing = complex(measured_response(frequency_hz)) - without
    velocity, acceleration = np.linalg.solve(
        [[by_velocity.real, by_acceleration.real], [by_velocity.imag, by_acceleration.imag]],
        [missing.real, missing.imag],
    ).tolist()
    whole = variables_from_gains(machine, with_feedforward(velocity, acceleration))
    variables = {**machine.controller.variables, **whole}
    return replace(machine, controller=replace(machine.controller, variables=variables))
