"""Axes of the simulated machine: a linear motor under a PID loop, and an ideal follower.

Both are stepped a block of servo cycles at a time. Positions are motor counts; an axis carries `origin`, the
machine position of motor zero, so that homing can move the zero without moving the iron.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


class Axis(Protocol):
    """What a motor of the simulated controller drives."""

    origin: float

    @property
    def output_fraction(self) -> float:
        """Controller output at the last servo cycle, as a share of its limit, -1 to 1."""

    def close_loop(self) -> float:
        """Begin to hold the present position; return it as the commanded one, in motor counts."""

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Run one servo cycle a command (counts); return the true position at each cycle."""

    def coast(self, cycles: int) -> list[float]:
        """Run `cycles` with the amplifier off; return the true position at each cycle."""

    def rebase(self, counts: float) -> None:
        """Make the present `counts` the new zero of the motor; the iron does not move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoGains:
    """The PID of the controller (Ix30 to Ix35, Ix08, Ix09) with its limits Ix63 and Ix69.

    Output in DAC bits = 2^-19 Ix30 (Ix08 (FE + (Ix32 CV + Ix35 CA)/128 + Ix33 IE/2^23) - Ix31 Ix09 AV/128),
    counts and counts per cycle (PMAC User Manual, PID; Software Reference, Ix30 to Ix35).
    """

    ix08: float
    ix09: float
    ix30: float
    ix31: float
    ix32: float
    ix33: float
    ix34: float
    ix35: float
    ix69: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearMotor:
    """A moving mass with viscous damping behind a current amplifier, as in Eq 9 and Table 4 of the paper."""

    mass_kg: float
    damping_n_s_per_m: float
    force_n_per_bit: float
    peak_output_bits: float
    counts_per_m: float


class ServoAxis:
    """A linear motor in closed loop: quantised encoder, PID, output limit, one cycle of output delay."""

    def __init__(self, motor: LinearMotor, gains: ServoGains, cycle_s: float, origin: float = 0.0) -> None:
        self.origin = origin
        self._motor = motor
        self._cycle_s = cycle_s
        self._x = 0.0  # counts
        self._v = 0.0  # counts/s
        self._force = 0.0  # output of the previous cycle, DAC bits
        self._command = 0.0
        self._command_step = 0.0
        self._encoder = 0.0
        self._integral = 0.0
        self.set_gains(gains)
        rate = motor.damping_n_s_per_m / motor.mass_kg
        decay = math.exp(-rate * cycle_s)
        speed_per_bit = motor.force_n_per_bit / motor.damping_n_s_per_m * motor.counts_per_m
        self._decay = decay
        self._glide = (1.0 - decay) / rate
        self._push_v = (1.0 - decay) * speed_per_bit
        self._push_x = (cycle_s - self._glide) * speed_per_bit

    @property
    def output_fraction(self) -> float:
        """Last output over its limit."""
        return self._force / self._limit

    def set_gains(self, gains: ServoGains) -> None:
        """Use other gains from the next cycle on."""
        scale = gains.ix30 / 2**19
        self._k_error = scale * gains.ix08
        self._k_velocity = self._k_error * gains.ix32 / 128
        self._k_acceleration = self._k_error * gains.ix35 / 128
        self._k_integral = self._k_error * gains.ix33 / 2**23
        self._k_damping = scale * gains.ix31 * gains.ix09 / 128
        self._integrate_in_motion = gains.ix34 == 0
        self._limit = min(gains.ix69, self._motor.peak_output_bits)

    def close_loop(self) -> float:
        """Hold the present encoder position."""
        self._encoder = self._command = math.floor(self._x + 0.5)
        self._command_step = self._integral = self._force = 0.0
        return self._command

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`."""
        self.origin += counts
        self._x -= counts
        self._command -= counts
        self._encoder -= counts

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Close the loop over the block. The local names are for speed: this is the innermost loop of all."""
        x, v, force = self._x, self._v, self._force
        last, last_step, last_encoder = self._command, self._command_step, self._encoder
        integral, limit, floor = self._integral, self._limit, math.floor
        k_error, k_velocity, k_acceleration = self._k_error, self._k_velocity, self._k_acceleration
        k_integral, k_damping, in_motion = self._k_integral, self._k_damping, self._integrate_in_motion
        decay, glide, push_x, push_v = self._decay, self._glide, self._push_x, self._push_v
        positions: list[float] = []
        for command in commands:
            positions.append(x)
            encoder = floor(x + 0.5)
            error = command - encoder
            step = command - last
            output = (
                k_error * error
                + k_velocity * step
                + k_acceleration * (step - last_step)
                + k_integral * integral
                - k_damping * (encoder - last_encoder)
            )
            last, last_step, last_encoder = command, step, encoder
            if output > limit:
                output = limit
            elif output < -limit:
                output = -limit
            elif in_motion or step == 0.0:
                integral += error
            # The output calculated in this cycle reaches the amplifier one cycle later.
            x, v = x + glide * v + push_x * force, decay * v + push_v * force
            force = output
        self._x, self._v, self._force = x, v, force
        self._command, self._command_step, self._encoder = last, last_step, last_encoder
        self._integral = integral
        return positions

    def coast(self, cycles: int) -> list[float]:
        """Let the slide run out against its damping."""
        positions = []
        x, v = self._x, self._v
        for _ in range(cycles):
            positions.append(x)
            x, v = x + self._glide * v, self._decay * v
        self._x, self._v, self._force = x, v, 0.0
        return positions


class IdealAxis:
    """An axis that is where it is told to be; switched off, it runs out with a time constant."""

    output_fraction = 0.0

    def __init__(self, cycle_s: float, coast_s: float, origin: float = 0.0) -> None:
        self.origin = origin
        self._x = 0.0
        self._step = 0.0
        self._keep = math.exp(-cycle_s / coast_s)

    def close_loop(self) -> float:
        """Stand still where it is."""
        self._step = 0.0
        return self._x

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`."""
        self.origin += counts
        self._x -= counts

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Be where the commands say."""
        positions = list(commands)
        if positions:
            before = positions[-2] if len(positions) > 1 else self._x
            self._x, self._step = positions[-1], positions[-1] - before
        return positions

    def coast(self, cycles: int) -> list[float]:
        """Run out."""
        positions = []
        for _ in range(cycles):
            self._step *= self._keep
            self._x += self._step
            positions.append(self._x)
        return positions
