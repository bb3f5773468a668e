"""The controller's side of an axis: the interface that a motor needs, and its PID loop with its notch filter."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign

from drivers.simulator.plant.axis import FARTHEST, ROUNDS, EncoderAxis, Ends, Scale
from drivers.simulator.plant.driven_mass import DrivenMass, DrySlide, Presliding, SimulatedMode
from drivers.simulator.plant.servo_gains import NotchFilter, ServoGains, notch_of
from drivers.simulator.plant.tip_load import TipLoad


class ServoAxis(EncoderAxis):
    """The loop of one motor: encoder, PID, output limit and one cycle of output delay, round a driven mass.

    It is stepped a block of servo cycles at a time, and carries the mechanical state with its own: position and
    speed are the only two numbers exchanged in each cycle. `output_bits` is the last output, up to `limit_bits`
    either way.

    `_follow_by_cycle` and `_drift_by_cycle` are the whole truth. `_close`, `_glide` and `_fall` are the same
    operations in the same order, to the last bit, for an axis without a notch filter that is not jammed and whose
    encoder counts; `_stay` returns the last block again where it has ended as it began.
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
        load: TipLoad | Presliding | None = None,
        mode: SimulatedMode | None = None,
    ) -> None:
        """Take the current's time constant `lag_s`, the encoder `scale`, an additional force, a flexible mode."""
        super().__init__(origin)
        self._mode = mode
        self._per_bit, self._lags = mass.acceleration_per_bit, lag_s > 0.0
        self.scale = scale or Scale()
        self._load = load
        self._ends, self._cycle_s = ends, cycle_s
        self._most_acceleration = mass.peak_output_bits * mass.acceleration_per_bit
        self._peak_bits = mass.peak_output_bits
        self._plant = plant = mass.zero_order_hold(cycle_s)
        self._held = plant.decay, plant.glide, plant.push_x, plant.push_v
        self._slide = DrySlide(mass, cycle_s, lag_s) if mass.friction or lag_s or load else None
        self._v = 0.0  # counts/s
        self.output_bits = 0.0  # output of the previous cycle, DAC bits
        self._command = 0.0
        self._command_step = self._integral = 0.0
        self._last_commands: Sequence[float] | None = None
        self._still: list[float] | None = None  # the last block, if the next one with its commands is the same
        self._rest: list[float] = []
        self._notch: NotchFilter | None = None
        self.set_gains(gains)

    def set_gains(self, gains: ServoGains) -> None:
        """Use other gains from the next cycle on."""
        # DAC = 2^-19 Ix30 {Ix08 [FE + (Ix32 CV + Ix35 CA) / 128 + Ix33 IE / 2^23] - Ix31 Ix09 AV / 128}, counts
        scale = gains.ix30 / 2**19
        k_error = scale * gains.ix08
        self._k = (
            k_error,
            k_error * gains.ix32 / 128,
            k_error * gains.ix35 / 128,
            k_error * gains.ix33 / 2**23 if gains.ix63 else 0.0,  # a limit of 0 leaves the integrator no output
            scale * gains.ix31 * gains.ix09 / 128,
        )
        self._integrate_in_motion = gains.ix34 == 0
        self._full_output = gains.ix69
        self.limit_bits = min(gains.ix69, self._peak_bits)
        notch, before = notch_of(gains), self._notch
        if notch is not None and before is not None:
            notch.continue_from(before)
        self._notch, self._still = notch, None

    def close_loop(self) -> float:
        """Hold the present encoder position."""
        self._read()
        self._command = self._reading
        self._command_step = self._integral = self.output_bits = 0.0
        self._still = None
        if self._notch is not None:
            self._notch.begin()
        return self._command

    def _shift_reading(self, counts: float) -> None:
        super()._shift_reading(counts)
        self._command -= counts

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`."""
        super().rebase(counts)
        self._still = None

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Close the loop over the block."""
        self.at_end, singly = False, self._mode is not None or self._notch is not None
        if singly or self.encoder_lost or self.jammed or not -FARTHEST < self._x < FARTHEST:
            return self._follow_by_cycle(commands)
        again = commands is self._last_commands
        if again and self._still is not None:
            return self._stay(self._still)
        self._last_commands, self._still, self._blind = commands, None, False
        if self._slide is not None:
            return self._glide_led(commands, self._slide)
        if self.scale.noisy:
            return self._follow_by_cycle(commands)
        if not again:
            return self._close(commands)
        before = (
            self._x,
            self._v,
            self.output_bits,
            self._integral,
            self._reading,
            self._command,
            self._command_step,
        )
        positions = self._close(commands)
        if self._repeats(before, commands):
            self._still = positions
        return positions

    def _close(self, commands: Sequence[float]) -> list[float]:
        """Close the loop without friction. The local names are for speed: this is the innermost loop of all."""
        x, v, force, integral = self._x, self._v, self.output_bits, self._integral
        last, last_step, last_encoder = self._command, self._command_step, self._reading
        k_e, k_v, k_a, k_i, k_d = self._k
        lowest, highest, whole, in_motion = -self.limit_bits, self.limit_bits, ROUNDS, self._integrate_in_motion
        decay, glide, push_x, push_v = self._held
        positions: list[float] = []
        append = positions.append
        for command in commands:
            append(x)
            encoder = x + whole - whole
            error = command - encoder
            step = command - last
            feed = k_e * error + k_v * step + k_a * (step - last_step)
            output = feed + k_i * integral - k_d * (encoder - last_encoder)
            last, last_step, last_encoder = command, step, encoder
            # The output calculated in this cycle reaches the amplifier one cycle later.
            x, v = x + glide * v + push_x * force, decay * v + push_v * force
            if lowest <= output <= highest:
                force = output
                if in_motion or step == 0.0:
                    integral += error
            else:
                force = highest if output > highest else lowest
        if self._ends is not None and not self._ends.leave(min(positions), max(positions), x, self.origin):
            return self._follow_by_cycle(commands)  # from where it was: nothing is kept yet
        self._x, self._v, self.output_bits, self._integral = x, v, force, integral
        self._command, self._command_step, self._reading = last, last_step, last_encoder
        return positions

    def _glide_led(self, commands: Sequence[float], slide: DrySlide) -> list[float]:
        """Close the loop on dry guides, a cycle at a time where the load is given for each."""
        noise = self.scale.draw(len(commands))
        if self._load is None or not self._load.led:
            return self._glide(commands, noise, slide)
        singly = [self._glide((told,), noise and noise[at : at + 1], slide) for at, told in enumerate(commands)]
        return [position for (position,) in singly]

    def _glide(self, commands: Sequence[float], noise: Sequence[float] | None, slide: DrySlide) -> list[float]:
        """Close the loop on dry guides, with current lag, under the load of a cut."""
        x, v, force, integral, driven = self._x, self._v, self.output_bits, self._integral, slide.driven
        last, last_step, last_encoder = self._command, self._command_step, self._reading
        k_e, k_v, k_a, k_i, k_d = self._k
        lowest, highest, whole, in_motion = -self.limit_bits, self.limit_bits, ROUNDS, self._integrate_in_motion
        friction, per_bit, left, mean, lag_x, lag_v, decay, glide, push_x, push_v = slide.constants
        load, origin = self._begin_load(), self.origin
        ends = self._ends_near(len(commands)) if load is None else self._ends
        positions: list[float] = []
        for command in commands:
            encoder = (x if noise is None else x + noise[len(positions)]) + whole - whole
            positions.append(x)
            error, step = command - encoder, command - last
            feed = k_e * error + k_v * step + k_a * (step - last_step)
            output = feed + k_i * integral - k_d * (encoder - last_encoder)
            last, last_step, last_encoder = command, step, encoder
            drive = force * per_bit
            late = driven - drive
            driven = drive + left * late
            drive = drive + mean * late if load is None else drive + mean * late + load.push(x + origin)
            if v or not friction:
                pull = drive - copysign(friction, v)
                later = decay * v + push_v * pull + lag_v * late
                if later * v > 0.0 or not friction:
                    x, v = x + glide * v + push_x * pull + lag_x * late, later
                else:
                    x, v = slide.stop(x, v, drive, late)
            elif not -friction <= drive <= friction:
                x, v = slide.start(x, drive, late)
            if ends is not None and not ends.lowest <= x + origin <= ends.highest:
                x, v = self._hold(x, ends)
            if lowest <= output <= highest:
                force = output
                if in_motion or step == 0.0:
                    integral += error
            else:
                force = highest if output > highest else lowest
        self._x, self._v, self.output_bits, self._integral, slide.driven = x, v, force, integral, driven
        self._command, self._command_step, self._reading = last, last_step, last_encoder
        return positions

    def push(self, output: float, cycles: int) -> list[float]:
        """Hold a fraction of Ix69, within the amplifier's limit, with the same delay as in closed loop."""
        return self._drift(max(-self.limit_bits, min(output * self._full_output, self.limit_bits)), cycles)

    def coast(self, cycles: int) -> list[float]:
        """Let the mass coast against its damping and friction."""
        self.output_bits = 0.0
        return self._drift(0.0, cycles)

    def _drift(self, held: float, cycles: int) -> list[float]:
        """Run in open loop."""
        self.at_end, self._still = False, None
        if self._mode is not None or self.encoder_lost or self.jammed or not -FARTHEST < self._x < FARTHEST:
            return self._drift_by_cycle(held, cycles)
        if self._slide is None:
            positions = self._fall(held, cycles)
        elif held or self.output_bits or self._v or not self._sticks(self._slide, cycles):
            return self._drift_by_cycle(held, cycles)
        else:
            positions = self._resting(cycles)
        noise = self.scale.draw(cycles)
        self._reading = (positions[-1] if noise is None else positions[-1] + noise[-1]) + ROUNDS - ROUNDS
        self._blind = False
        return positions

    def _fall(self, held: float, cycles: int) -> list[float]:
        """Run in open loop without friction."""
        x, v, force, plant = self._x, self._v, self.output_bits, self._plant
        decay, glide, push_x, push_v = plant.decay, plant.glide, plant.push_x, plant.push_v
        if not held and not force and x + glide * v == x:
            self._v = _fade_speed(v, decay, cycles)
            return self._resting(cycles)
        ends, origin = self._ends_near(cycles), self.origin
        positions = []
        for _ in range(cycles):
            positions.append(x)
            x, v = x + glide * v + push_x * force, decay * v + push_v * force
            if ends is not None and not ends.lowest <= x + origin <= ends.highest:
                x, v = self._hold(x, ends)
            force = held
        self._x, self._v, self.output_bits = x, v, force
        return positions

    def _sticks(self, slide: DrySlide, cycles: int) -> bool:
        """Whether a dry slide at rest stays there while its current fades; if so, it has faded afterwards."""
        return self._begin_load() is None and slide.fades(cycles)

    def _resting(self, cycles: int) -> list[float]:
        """Return a block at rest: the same list each time, so that others see at once that nothing has moved."""
        if len(self._rest) != cycles or self._rest[0] != self._x:
            self._rest = [self._x] * cycles
        return self._rest

    def _stay(self, positions: list[float]) -> list[float]:
        """Return the last block again. What is left of the speed, too little to move anything, fades."""
        if self._v:
            self._v = _fade_speed(self._v, self._plant.decay, len(positions))
        return positions

    def _repeats(self, before: tuple[float, ...], commands: Sequence[float]) -> bool:
        """Whether the block just closed on constant commands will be the same again.

        All but the speed is as before it, the output is 0, and the speed, which only fades, is too little to
        change the position in a cycle.
        """
        x, v, force, *_ = before
        if force or x + self._plant.glide * v != x:
            return False
        state = self._x, v, self.output_bits, self._integral, self._reading, self._command, self._command_step
        return state == before and not self._command_step and commands.count(commands[0]) == len(commands)

    def _begin_load(self) -> TipLoad | Presliding | None:
        """Begin a block of the load; return None without a load in this block."""
        load = self._load
        if load is None:
            return None
        load.begin()
        return load if load.acts else None

    def _drift_by_cycle(self, held: float, cycles: int) -> list[float]:
        """Run in open loop, a cycle at a time."""
        positions = []
        if self._load is not None:
            self._load.begin()
        for _ in range(cycles):
            positions.append(self._place())
            self._read()
            self._move()
            self.output_bits = held
        return positions

    def _follow_by_cycle(self, commands: Sequence[float]) -> list[float]:
        """Close the loop, a cycle at a time."""
        positions = []
        self._still = None
        if self._load is not None:
            self._load.begin()
        for command in commands:
            positions.append(self._place())
            before = self._reading
            self._read()
            output = self._respond(command, self._reading - before)
            self._move()
            self.output_bits = output
        return positions

    def _respond(self, command: float, encoder_step: float) -> float:
        """Return the output of one cycle, in DAC bits."""
        k_e, k_v, k_a, k_i, k_d = self._k
        error, step = command - self._reading, command - self._command
        output = (
            k_e * error
            + k_v * step
            + k_a * (step - self._command_step)
            + k_i * self._integral
            - k_d * encoder_step
        )
        self._command, self._command_step = command, step
        notch = self._notch
        if notch is not None:
            output = notch.filter_output(output)
        beyond = abs(output) > self.limit_bits
        if beyond:
            output = copysign(self.limit_bits, output)
        elif self._integrate_in_motion or step == 0.0:
            self._integral += error  # not while the output is limited: the loop would overshoot on its way back
        if notch is not None:
            notch.put_out(output)
        return output

    def _place(self) -> float:
        """Return where scale and tip are: the rigid position and what a mode bends."""
        return self._x if self._mode is None else self._x + self._mode.bend

    def _read(self) -> None:
        self._blind = self.encoder_lost
        if not self._blind:
            self._reading = float(self.scale.read(self._place()))

    def _move(self) -> None:
        """Advance the mass for a cycle under its present force."""
        before = 0.0 if self._slide is None else self._slide.driven
        if self.jammed:
            self._v = 0.0
        elif self._slide:
            load = self._load.push(self._x + self.origin) if self._load is not None else 0.0
            self._x, self._v = self._slide.step(self._x, self._v, self.output_bits, load)
        else:
            plant, v, force = self._plant, self._v, self.output_bits
            self._x = self._x + plant.glide * v + plant.push_x * force
            self._v = plant.decay * v + plant.push_v * force
        if self._mode is not None:
            slide, pull = self._slide, self._per_bit * self.output_bits
            self._mode.step(pull, before - pull if slide is not None and self._lags else 0.0)
        ends = self._ends
        if ends is not None and not ends.lowest <= self._x + self.origin <= ends.highest:
            self._x, self._v = self._hold(self._x, ends)

    def _hold(self, x: float, ends: Ends) -> tuple[float, float]:
        """Return position and speed at the end of travel that holds the axis."""
        self.at_end = self.hit_end = True
        return ends.holds(x + self.origin) - self.origin, 0.0

    def _ends_near(self, cycles: int) -> Ends | None:
        """Return the ends of travel if one is near enough to be reached within so many cycles without a load."""
        ends, time_s = self._ends, cycles * self._cycle_s
        if ends is None:
            return None
        reach = (abs(self._v) + self._most_acceleration * time_s) * time_s
        return None if ends.lowest + reach < self._x + self.origin < ends.highest - reach else ends


def _fade_speed(v: float, decay: float, cycles: int) -> float:
    """Return a speed after so many cycles without a force: each is its own rounding."""
    for _ in range(cycles):
        v = decay * v
    return v
