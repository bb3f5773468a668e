"""The controller's side of an axis: the interface that a motor needs, and its PID loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.simulator.plant.axis import EncoderAxis, Ends, Scale
from drivers.simulator.plant.driven_mass import DrivenMass, DrySlide
from drivers.simulator.plant.tip_load import TipLoad


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoGains:
    """The PID of the controller (Ix30 to Ix35, Ix08, Ix09) with its output limit Ix69.

    Of Ix63, the integrator limit, only 0 has an effect: it disables the integrator.

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
    ix63: float = 4_194_304.0
    ix69: float


class ServoAxis(EncoderAxis):
    """The loop of one motor: encoder, PID, output limit and one cycle of output delay, round a driven mass.

    It is stepped a block of servo cycles at a time, and carries the mechanical state with its own: position and
    speed are the only two numbers exchanged in each cycle. `output_bits` is the last output, up to `limit_bits`
    either way.
    """

    def __init__(
        self,
        mass: DrivenMass,
        gains: ServoGains,
        cycle_s: float,
        origin: float = 0.0,
        ends: Ends | None = None,
        scale: Scale | None = None,
        lag_s: float = 0.0,
        load: TipLoad | None = None,
    ) -> None:
        """Take `lag_s`, the current's time constant, `scale`, the encoder, and `load`, an additional force."""
        super().__init__(origin)
        self.scale = scale or Scale()
        self._load = load
        self._ends = ends
        self._cycle_s = cycle_s
        self._most_acceleration = mass.peak_output_bits * mass.acceleration_per_bit
        self._peak_bits = mass.peak_output_bits
        self._plant = mass.held(cycle_s)
        self._slide = DrySlide(mass, cycle_s, lag_s) if mass.friction or lag_s or load else None
        self._v = 0.0  # counts/s
        self.output_bits = 0.0  # output of the previous cycle, DAC bits
        self._command = 0.0
        self._command_step = 0.0
        self._integral = 0.0
        self.set_gains(gains)

    def set_gains(self, gains: ServoGains) -> None:
        """Use other gains from the next cycle on."""
        scale = gains.ix30 / 2**19
        self._k_error = scale * gains.ix08
        self._k_velocity = self._k_error * gains.ix32 / 128
        self._k_acceleration = self._k_error * gains.ix35 / 128
        self._k_integral = self._k_error * gains.ix33 / 2**23 if gains.ix63 else 0.0
        self._k_damping = scale * gains.ix31 * gains.ix09 / 128
        self._integrate_in_motion = gains.ix34 == 0
        self._full_output = gains.ix69
        self.limit_bits = min(gains.ix69, self._peak_bits)

    def close_loop(self) -> float:
        """Hold the present encoder position."""
        self._read()
        self._command = self._reading
        self._command_step = self._integral = self.output_bits = 0.0
        return self._command

    def _shift_reading(self, counts: float) -> None:
        super()._shift_reading(counts)
        self._command -= counts

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Close the loop over the block. The local names are for speed: this is the innermost loop of all."""
        self.at_end = False
        if self.encoder_lost or self.jammed or self._slide or self._may_reach_end(len(commands)):
            return self._follow_by_cycle(commands)
        x, v, force = self._x, self._v, self.output_bits
        last, last_step, last_encoder = self._command, self._command_step, self._reading
        integral, limit, read = self._integral, self.limit_bits, self.scale.read
        k_error, k_velocity, k_acceleration = self._k_error, self._k_velocity, self._k_acceleration
        k_integral, k_damping, in_motion = self._k_integral, self._k_damping, self._integrate_in_motion
        plant = self._plant
        decay, glide, push_x, push_v = plant.decay, plant.glide, plant.push_x, plant.push_v
        positions: list[float] = []
        for command in commands:
            positions.append(x)
            encoder = read(x)
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
        self._x, self._v, self.output_bits = x, v, force
        self._command, self._command_step, self._reading = last, last_step, last_encoder
        self._integral, self._blind = integral, False
        return positions

    def push(self, output: float, cycles: int) -> list[float]:
        """Hold a fraction of Ix69, within the amplifier's limit, with the same delay as in closed loop."""
        return self._drift(max(-self.limit_bits, min(output * self._full_output, self.limit_bits)), cycles)

    def coast(self, cycles: int) -> list[float]:
        """Let the mass coast against its damping and friction."""
        self.output_bits = 0.0
        return self._drift(0.0, cycles)

    def _drift(self, held: float, cycles: int) -> list[float]:
        positions = []
        self.at_end = False
        if self._load is not None:
            self._load.begin()
        for _ in range(cycles):
            positions.append(self._x)
            self._read()
            self._move()
            self.output_bits = held
        return positions

    def _follow_by_cycle(self, commands: Sequence[float]) -> list[float]:
        """Close the loop under a fault: the same as `follow`, a cycle at a time."""
        positions = []
        if self._load is not None:
            self._load.begin()
        for command in commands:
            positions.append(self._x)
            before = self._reading
            self._read()
            output = self._respond(command, self._reading - before)
            self._move()
            self.output_bits = output
        return positions

    def _respond(self, command: float, encoder_step: float) -> float:
        """Return the output of one cycle, in DAC bits, as `follow` calculates it."""
        error, step = command - self._reading, command - self._command
        output = (
            self._k_error * error
            + self._k_velocity * step
            + self._k_acceleration * (step - self._command_step)
            + self._k_integral * self._integral
            - self._k_damping * encoder_step
        )
        self._command, self._command_step = command, step
        if abs(output) > self.limit_bits:
            return math.copysign(self.limit_bits, output)
        if self._integrate_in_motion or step == 0.0:
            self._integral += error
        return output

    def _read(self) -> None:
        self._blind = self.encoder_lost
        if not self._blind:
            self._reading = self.scale.read(self._x)

    def _move(self) -> None:
        """Advance the mass for a cycle under its present force."""
        if self.jammed:
            self._v = 0.0
        elif self._slide:
            load = self._load.push(self._x + self.origin) if self._load is not None else 0.0
            self._x, self._v = self._slide.step(self._x, self._v, self.output_bits, load)
        else:
            plant, v, force = self._plant, self._v, self.output_bits
            # In the order of `follow`, to the last bit: the results must be identical.
            self._x = self._x + plant.glide * v + plant.push_x * force
            self._v = plant.decay * v + plant.push_v * force
        ends = self._ends
        if ends is not None and not ends.lowest <= self._x + self.origin <= ends.highest:
            self._x, self._v, self.at_end = ends.holds(self._x + self.origin) - self.origin, 0.0, True

    def _may_reach_end(self, cycles: int) -> bool:
        """Whether an end of travel is near enough to be reached within so many cycles."""
        if self._ends is None:
            return False
        time_s, place = cycles * self._cycle_s, self._x + self.origin
        reach = (abs(self._v) + self._most_acceleration * time_s) * time_s
        return not self._ends.lowest + reach < place < self._ends.highest - reach
