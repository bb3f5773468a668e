"""The position loop of the tool as the controller runs it: a sampled PID, its plant behind a hold, and a delay.

The plant a / (s (s + b)), in m/s2 per V, follows a zero-order hold of one servo period; the output acts one period
late; with z = exp(j w T) and the gains of `PidGains`

P(z) = (n1 z + n0) / ((z - 1) (z - d)),    d = exp(-b T)
    B(z) = kp + ki T z / (z - 1) + kd (z - 1) / (T z)                    on the position that was read
    F(z) = kp + ki T z / (z - 1) + kvff (z - 1) / (T z) + kaff ((z - 1) / (T z))^2     on the command
    L = P B / z,    closed loop P F / z / (1 + L)

A notch filter N(z) / D(z) of the gains multiplies both B and F (`profiles.axis.notch`).

A flexible mode adds a c / (s^2 + 2 z w s + w^2) to the plant, as its step-invariant sampling (K. J. Astrom and
B. Wittenmark, Computer-Controlled Systems, table 2.1). A lag of the current, 1 / (1 + lag s), splits each of them
by partial fractions into one without and one of the lag, so that the sampling stays exact. An extra delay of the
plant multiplies P by exp(-j w delay).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.servo_gains import PidGains, gains_from_variables
from profiles.machine import MachineProfile

_AS_DOUBLE = 1e-6  # b T below which the plant is computed as a double integrator: differences would cancel
LOWEST_HZ = 1e-6  # replaces 0 Hz, where the integrators have their poles


@dataclass(frozen=True, slots=True, kw_only=True)
class FlexibleMode:
    """A resonance of the axis: frequency, damping ratio, and its fraction of the rigid axis' acceleration.

    The fraction is negative where the scale and the motor are on either side of what bends.
    """

    hz: float
    damping_ratio: float
    fraction: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisPlant:
    """The moved axis a / (s (s + b)): a in m/s2 per V of the output, b in 1/s, and a delay beyond the period.

    The current follows the output with the time constant `lag_s`. `modes` are what else the scale sees of the
    axis, above the rigid motion.
    """

    acceleration_per_v: float
    damping_per_s: float
    delay_s: float = 0.0
    lag_s: float = 0.0
    modes: tuple[FlexibleMode, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledLoop:
    """One loop: its plant, its gains and its servo period."""

    plant: AxisPlant
    gains: PidGains
    period_s: float

    @property
    def nyquist_hz(self) -> float:
        """Half the sampling rate, above which the loop has no response."""
        return 0.5 / self.period_s

    def plant_response(self, frequency_hz: ArrayLike) -> Complexes:
        """Return P / z with its extra delay, m/V."""
        z, hz = self._z(frequency_hz)
        (rigid, (*_, decay)), *others = self._held_parts()
        held = np.polyval(rigid, z) / ((z - 1.0) * (z - decay))  # as factors it is exact close to z = 1
        for above, below in others:
            held = held + np.polyval(above, z) / np.polyval(below, z)
        return complexes(held / z * np.exp(-2j * np.pi * hz * self.plant.delay_s))

    def feedback(self, frequency_hz: ArrayLike) -> Complexes:
        """Return B, V/m."""
        z, _ = self._z(frequency_hz)
        return self._filter_gain(self._shared_gain(z) + self.gains.kd_v_s_per_m * self._slope(z), z)

    def forward(self, frequency_hz: ArrayLike) -> Complexes:
        """Return F, V/m."""
        z, _ = self._z(frequency_hz)
        gains, slope = self.gains, self._slope(z)
        velocity = gains.velocity_feedforward_v_s_per_m * slope
        ahead = self._shared_gain(z) + velocity + gains.acceleration_feedforward_v_s2_per_m * slope**2
        return self._filter_gain(ahead, z)

    def open_loop(self, frequency_hz: ArrayLike) -> Complexes:
        """Return L, the loop opened at its output."""
        return complexes(self.plant_response(frequency_hz) * self.feedback(frequency_hz))

    def closed_loop(self, frequency_hz: ArrayLike) -> Complexes:
        """Return the response from commanded to actual position."""
        plant = self.plant_response(frequency_hz)
        return complexes(plant * self.forward(frequency_hz) / (1.0 + plant * self.feedback(frequency_hz)))

    def poles(self) -> Complexes:
        """Return the poles of the closed loop without the extra delay; stable with all inside the unit circle."""
        return complexes(np.roots(self.closed_polynomials()[1]))

    def closed_polynomials(self, *, delayed: bool = False) -> tuple[Floats, Floats]:
        """Return numerator and denominator of the closed loop in falling powers of z, as long as each other.

        The extra delay is left out, unless `delayed`, where it is linear between two periods. With B = Bn / (z c)
        and F = Fn / (z^2 c), where c = z - 1 with an integrator and 1 without, it is N Fn / (z (z^2 c D + N Bn)).
        A notch filter counts as a part of the plant.
        """
        gains, period_s = self.gains, self.period_s
        plant_above, plant_below = self.plant_polynomials()
        if gains.notch:
            plant_above = floats(np.polymul(plant_above, gains.notch.numerator))
            plant_below = floats(np.polymul(plant_below, gains.notch.denominator))
        if delayed and self.plant.delay_s:
            late, spread = self._delay_polynomials()
            plant_above, plant_below = (
                floats(np.polymul(plant_above, spread)),
                floats(np.polymul(plant_below, late)),
            )
        integrating = gains.ki_v_per_m_s != 0.0
        common = [1.0, -1.0] if integrating else [1.0]
        shared = np.polymul([gains.kp_v_per_m, 0.0], common)
        if integrating:
            shared = np.polyadd(shared, [gains.ki_v_per_m_s * period_s, 0.0, 0.0])
        derivative = np.polymul([gains.kd_v_s_per_m / period_s, -gains.kd_v_s_per_m / period_s], common)
        velocity, acceleration = (
            gains.velocity_feedforward_v_s_per_m / period_s,
            gains.acceleration_feedforward_v_s2_per_m / period_s**2,
        )
        ahead = np.polymul(
            np.polyadd([velocity, -velocity, 0.0], [acceleration, -2 * acceleration, acceleration]), common
        )
        forward = np.polyadd(np.polymul(shared, [1.0, 0.0]), ahead)
        own = np.polymul(np.polymul([1.0, 0.0, 0.0], common), plant_below)
        closed = np.polyadd(own, np.polymul(plant_above, np.polyadd(shared, derivative)))
        denominator = np.polymul(closed, [1.0, 0.0])
        numerator = np.polymul(plant_above, forward)
        padded = np.concatenate([np.zeros(len(denominator) - len(numerator)), numerator])
        return floats(padded), floats(denominator)

    def _delay_polynomials(self) -> tuple[list[float], list[float]]:
        """Return the extra delay as a denominator, powers of z, and a numerator of two samples."""
        whole, part = divmod(self.plant.delay_s / self.period_s, 1.0)
        return [1.0, *[0.0] * (int(whole) + 1)], [1.0 - part, part]

    def force_polynomials(self) -> tuple[Floats, Floats]:
        """Return numerator and denominator from a force on the rigid axis, in volts of output, to the position.

        With the closed loop's denominator z (z^2 c D + N Bn) and the rigid part Nr / Dr of the plant it is
        Nr z^3 c (D / Dr) over that; the force is held for a period, and acts without the delay of the output.
        """
        n1, n0, _ = self._held_plant()
        above = np.polymul([n1, n0], [1.0, 0.0, 0.0, 0.0])
        if self.gains.ki_v_per_m_s != 0.0:
            above = np.polymul(above, [1.0, -1.0])
        for mode in self.plant.modes:
            above = np.polymul(above, self._held_mode(mode)[1])
        if self.plant.lag_s:
            above = np.polymul(above, [1.0, -math.exp(-self.period_s / self.plant.lag_s)])
        if self.gains.notch:
            above = np.polymul(above, self.gains.notch.denominator)
        if self.plant.delay_s:
            above = np.polymul(above, self._delay_polynomials()[0])
        _, below = self.closed_polynomials(delayed=True)
        return floats(np.concatenate([np.zeros(len(below) - len(above)), above])), below

    def plant_polynomials(self) -> tuple[Floats, Floats]:
        """Return numerator and denominator of the plant behind its hold, with its lag and modes."""
        (above, below), *others = self._held_parts()
        for own_above, own_below in others:
            above = floats(np.polyadd(np.polymul(above, own_below), np.polymul(own_above, below)))
            below = floats(np.polymul(below, own_below))
        return above, below

    def _held_parts(self) -> list[tuple[Floats, Floats]]:
        """Return the fractions whose sum is the held plant: of the rigid axis, of each mode, and of the lag.

        With G = N / D(s), D = s^2 + ... + D0, and q = G(-1 / lag)
        G / (1 + lag s) = (N - q D0) / D - (q / lag) s / D + q / (1 + lag s).
        """
        plant, lag_s, period_s = self.plant, self.plant.lag_s, self.period_s
        n1, n0, decay = self._held_plant()
        x = plant.damping_per_s * period_s
        glide_s = period_s if x < _AS_DOUBLE else -math.expm1(-x) / plant.damping_per_s
        rigid = floats([n1, n0]), floats([1.0, -1.0 - decay, decay])
        held = [rigid, *(self._held_mode(mode) for mode in plant.modes)]
        if not lag_s:
            return held
        rate, left, lagging = 1.0 / lag_s, math.exp(-period_s / lag_s), 0.0
        shapes = [(1.0, plant.damping_per_s, 0.0, glide_s)]
        for mode in plant.modes:
            omega, damped, fade = self._mode_figures(mode)
            slope_s = fade * math.sin(damped * period_s) / damped
            shapes.append((mode.fraction, 2.0 * mode.damping_ratio * omega, omega**2, slope_s))
        parts = list[tuple[Floats, Floats]]()
        for (above, below), (fraction, d1, d0, slope_s) in zip(held, shapes, strict=True):
            per_n = 1.0 / (rate**2 - d1 * rate + d0)
            q = fraction * plant.acceleration_per_v * per_n
            parts.append((floats((1.0 - per_n * d0) * above - q * rate * slope_s * floats([1.0, -1.0])), below))
            lagging += q
        return [*parts, (floats([lagging * (1.0 - left)]), floats([1.0, -left]))]

    def _held_mode(self, mode: FlexibleMode) -> tuple[Floats, Floats]:
        """Return numerator and denominator of a mode behind its hold: e = exp(-z w T), d = w sqrt(1 - z^2)."""
        omega, damped, fade = self._mode_figures(mode)
        ratio, turn = mode.damping_ratio, damped * self.period_s
        skew = ratio * omega / damped * math.sin(turn)
        scale = mode.fraction * self.plant.acceleration_per_v / omega**2
        above = [scale * (1.0 - fade * (math.cos(turn) + skew)), scale * fade * (fade + skew - math.cos(turn))]
        return floats(above), floats([1.0, -2.0 * fade * math.cos(turn), fade**2])

    def _mode_figures(self, mode: FlexibleMode) -> tuple[float, float, float]:
        """Return w and d of a mode, 1/s, and e."""
        omega = 2.0 * math.pi * mode.hz
        damped = omega * math.sqrt(1.0 - mode.damping_ratio**2)
        return omega, damped, math.exp(-mode.damping_ratio * omega * self.period_s)

    def _z(self, frequency_hz: ArrayLike) -> tuple[Complexes, Floats]:
        hz = np.maximum(floats(frequency_hz), LOWEST_HZ)
        return complexes(np.exp(2j * np.pi * hz * self.period_s)), floats(hz)

    def _filter_gain(self, gain: Complexes, z: Complexes) -> Complexes:
        notch = self.gains.notch
        return complexes(gain * notch.response_at(z) if notch else gain)

    def _slope(self, z: Complexes) -> Complexes:
        return complexes((1.0 - 1.0 / z) / self.period_s)

    def _shared_gain(self, z: Complexes) -> Complexes:
        return complexes(self.gains.kp_v_per_m + self.gains.ki_v_per_m_s / self._slope(z))

    def _held_plant(self) -> tuple[float, float, float]:
        """Return n1, n0 and d of the plant behind its hold."""
        plant, period_s = self.plant, self.period_s
        x = plant.damping_per_s * period_s
        if x < _AS_DOUBLE:
            half = 0.5 * plant.acceleration_per_v * period_s**2
            return half, half, 1.0
        decay, lost = math.exp(-x), -math.expm1(-x) / x
        scale = plant.acceleration_per_v / plant.damping_per_s * period_s
        return scale * (1.0 - lost), scale * (lost - decay), decay


def profile_plant(machine: MachineProfile) -> AxisPlant:
    """Return the tool by the masses and motor constants of its profile."""
    tool = machine.tool
    mass_kg = tool.moving_mass_kg
    return AxisPlant(
        acceleration_per_v=tool.loop_gain_n_per_v / mass_kg, damping_per_s=tool.damping_n_s_per_m / mass_kg
    )


def loop_of(machine: MachineProfile, plant: AxisPlant | None = None) -> SampledLoop:
    """Return the loop with the gains and the servo period of a profile; raises as `gains_from_variables`."""
    return SampledLoop(
        plant=profile_plant(machine) if plant is None else plant,
        gains=gains_from_variables(machine),
        period_s=machine.controller.servo_period_ms / 1000.0,
    )
