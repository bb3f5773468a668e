"""The loop of a motor: its state in every servo cycle, and its checks in the background cycle."""

from __future__ import annotations

from math import inf
from typing import Final, NamedTuple

from drivers.pmac.reported_velocity import averaged_velocity
from drivers.pmac.settings import PARTS_PER_COUNT
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.guard import Guard, MotorFault, TravelLimits, read_guard
from drivers.simulator.card.jog_motion import HomeSensor, JogMotion, TriggerStage
from drivers.simulator.plant.axis import Axis, Scale, count_position, counted_along

_SEARCHING: Final = TriggerStage.SEARCHING  # a look-up less in every block


class MotorReadout(NamedTuple):
    """What registers read of a motor after a servo cycle; `noise` and `noise_before` are of the scale."""

    desired: float
    velocity: float
    actual: float
    last_actual: float
    correction: float
    noise: float
    noise_before: float


class _RecordedStretch(NamedTuple):
    """A stretch as it was run; `commands` is None in open loop, `corrections` where the same one was added."""

    track: list[float]
    noise: list[float] | None
    commands: list[float] | None
    corrections: list[float]
    cycle_ms: float


class Replay:
    """The last stretch of a motor, counts. What is asked of it is worked out once, and only then.

    `encoders` and `commands` are also what a table sees of a motor that has not been run.
    """

    def __init__(self) -> None:
        self._begun = 0.0, 0.0, 0.0
        self._kept = _RecordedStretch([], None, [], [], 1.0)
        self._encoders: list[float] | None = None
        self._commands: list[float] | None = None
        self._cycles: list[MotorReadout] | None = None

    @property
    def encoders(self) -> list[float]:
        """What the encoder counts in each cycle."""
        if self._encoders is None:
            track, noise = self._kept.track, self._kept.noise
            places = track if noise is None else [place + each for place, each in zip(track, noise, strict=True)]
            self._encoders = counted_along(places)
        return self._encoders

    @property
    def commands(self) -> list[float]:
        """The commanded position in each cycle; in open loop it goes along with the encoder."""
        if self._commands is None:
            told, corrections = self._kept.commands, self._kept.corrections
            if told is None:
                encoders = self.encoders
                told = [encoders[at] - corrections[at] for at in range(len(encoders))]
            self._commands = told
        return self._commands

    @property
    def corrections(self) -> list[float]:
        """What tables add in each cycle."""
        return self._kept.corrections

    @property
    def encoder_steps(self) -> list[float]:
        """Actual velocity in each cycle, counts per cycle."""
        encoders, (_, actual, noise) = self.encoders, self._begun
        last, steps = count_position(actual + noise), []
        for encoder in encoders:
            steps.append(encoder - last)
            last = encoder
        return steps

    @property
    def cycles(self) -> list[MotorReadout]:
        """All of it, cycle by cycle."""
        if self._cycles is None:
            desired, actual, noise_before = self._begun
            kept, commands = self._kept, self.commands
            noise = kept.noise or [0.0] * len(kept.track)
            velocity = [0.0] * len(kept.track)
            if kept.commands is not None:
                before = [desired, *commands[:-1]]
                velocity = [(now - then) / kept.cycle_ms for now, then in zip(commands, before, strict=True)]
            actuals, noises = [actual, *kept.track[:-1]], [noise_before, *noise[:-1]]
            columns = commands, velocity, kept.track, actuals, kept.corrections, noise, noises
            self._cycles = list(map(MotorReadout, *columns))
        return self._cycles

    def begin(self, desired: float, actual: float, noise: float) -> None:
        """Take the state before a stretch."""
        self._begun = desired, actual, noise

    def stand(self, encoder: float, desired: float, cycles: int) -> None:
        """Let it be a stretch of a motor that keeps its position, until it is run through it."""
        self._encoders, self._commands = [encoder] * cycles, [desired] * cycles

    def keep(
        self,
        track: list[float],
        noise: list[float] | None,
        commands: list[float] | None,
        corrections: list[float],
        cycle_ms: float,
    ) -> None:
        """Keep the stretch just run, with its `commands`, None in open loop, and the `corrections` beside them."""
        self._kept = _RecordedStretch(track, noise, commands, corrections, cycle_ms)
        self._encoders = self._commands = self._cycles = None


class MotorLoop:
    """Commanded and actual position of a motor, in counts from its zero; `axis` is the hardware it drives.

    `enabled` is closed loop. `program_timer` is whether a coordinate system is playing a program with this motor.
    `stopped_at` is where a resumable program has left the motor. `fault_input` is the amplifier fault input, set
    from outside, as are the pins of `travel` and `index_lost`, which suppresses the home trigger.

    The loop's command is `desired` plus `correction` (of compensation tables, or from a write to their register)
    plus `superimposed` (followed from a master and not yet part of `desired`), all in counts. The followed
    distance becomes part of `desired` as soon as nothing else moves the motor, unless `offset_following` keeps it
    out. `bias` is by how much PSET and the like have moved the zero of the axes. `true_position` is the machine
    position of the axis, whatever the encoder reads, `pace` its movement in the last servo cycle, and `cycles_run`
    the number of cycles run. `scale` is the axis's scale.
    """

    def __init__(self, number: int, variables: VariableStore, axis: Axis, home: HomeSensor) -> None:
        self.number = number
        self.axis = axis
        self.enabled = False
        self.home_complete = False
        self.home_capture = 0.0
        self.fatal_error = False
        self.amplifier_fault = False
        self.fault_input = False
        self.desired = 0.0
        self.velocity = 0.0  # commanded, counts/ms
        self.actual = 0.0
        self.correction = 0.0
        self.superimposed = 0.0
        self.offset_following = False
        self.bias = 0.0
        self.variable_jog = 0.0
        self.true_position = axis.origin
        self.pace = 0.0
        self.cycles_run = 0
        self.scale = Scale()
        self.index_lost = False
        self.program_timer = False
        self.stopped_at: float | None = None
        self.travel = TravelLimits()
        self._output: float | None = None
        self._last_actual = 0.0
        self._followed_since_scan = 0.0
        self._correction_at_scan = 0.0
        self._lost_counts, self._losing = 0.0, False
        self._variables = variables
        self._home = home
        self.jog = JogMotion(number, variables)
        self._power_up_origin = axis.origin
        self._poller = 0
        self._track, self._machine, self._origin = list[float](), list[float](), 0.0
        self.replay = Replay()
        self._averaged = averaged_velocity(variables)
        self._guard = read_guard(variables, number)
        self._guard_revision = variables.i_revision

    @property
    def amplifier_enabled(self) -> bool:
        """Whether the amplifier is enabled: in closed loop, or with an open-loop output."""
        return self.enabled or self._output is not None

    @property
    def encoder(self) -> float:
        """Actual position as the encoder counts it."""
        return count_position(self.actual + self.scale.now)

    @property
    def counter(self) -> float:
        """The encoder count since power-up, with the fraction of a count; homing does not change it."""
        return self.actual + self.axis.origin - self._lost_counts

    @property
    def net_desired(self) -> float:
        """The commanded position of the loop, in counts."""
        return self.desired + self.correction + self.superimposed

    @property
    def encoder_step(self) -> float:
        """Actual velocity in counts per servo cycle."""
        return self.encoder - count_position(self._last_actual + self.scale.before)

    @property
    def reported_velocity(self) -> float:
        """What V reports, counts per servo cycle."""
        return self.encoder_step if self._averaged is None else self._averaged.counts_per_cycle

    @property
    def following_error(self) -> float:
        """Commanded minus actual position, in counts; 0 in open loop."""
        return self.net_desired - self.encoder if self.enabled else 0.0

    @property
    def warning(self) -> bool:
        """Whether the following error is above Ix12, or was when it killed the motor."""
        return self.fatal_error or abs(self.following_error) > self.guard.warning_error

    @property
    def in_position(self) -> bool:
        """Closed loop, at rest, no program timer, and within Ix28, for the required number of scans."""
        guard = self.guard
        return self._poller > guard.polls and self._is_settled(abs(self.following_error), guard)

    def judge_error(self) -> tuple[bool, bool]:
        """Return `warning` and `in_position`, from one sample of the following error."""
        error, guard = abs(self.following_error), self.guard
        settled = self._poller > guard.polls and self._is_settled(error, guard)
        return self.fatal_error or error > guard.warning_error, settled

    @property
    def guard(self) -> Guard:
        """The monitored settings, as they are now."""
        revision = self._variables.i_revision
        if revision != self._guard_revision:
            self._guard, self._guard_revision = read_guard(self._variables, self.number), revision
        return self._guard

    def variable(self, number: int) -> float:
        """Return Ix`number` of this motor."""
        return self._variables.motor(self.number, number)

    def run(
        self, cycles: int, cycle_ms: float, commands: list[float] | None, corrections: list[float] | None = None
    ) -> list[float]:
        """Run a block, of the motor's own jog without `commands`; return the true machine positions (counts).

        `corrections` are those of tables in each cycle, where they change.
        """
        axis = self.axis
        if self._losing or axis.encoder_lost:
            self._count_losses()
        if self.superimposed and not (self.offset_following or self.program_timer or self.jog.player):
            self._absorb()
        if corrections is not None:
            self.correction = corrections[-1]
        added = self.correction + self.superimposed
        if not self.enabled:
            track = axis.coast(cycles) if self._output is None else axis.push(self._output, cycles)
            self.velocity = 0.0
        else:
            commands = self.jog.sample(cycles, cycle_ms, self.desired) if commands is None else commands
            track = axis.follow(_sum(commands, corrections, added))
            before = commands[-2] if cycles > 1 else self.desired
            self.desired, self.velocity = commands[-1], (commands[-1] - before) / cycle_ms
        start, machine = self.true_position, self._in_machine(track, axis.origin)
        self.true_position = machine[-1]
        self.pace = machine[-1] - (machine[-2] if cycles > 1 else start)
        if self._averaged is not None:
            for at in self._averaged.kept_cycles(cycles, self.cycles_run):
                self._averaged.keep(self.encoder if self._losing else count_position(track[at] + self.scale.now))
        self.cycles_run += cycles
        if self._losing:
            self._last_actual = self.actual
        else:
            self._last_actual = track[-2] if cycles > 1 else self.actual
            self.actual = track[-1]
        if not self.enabled:
            self.desired = count_position(self.actual + self.scale.now) - added
        if self.jog.stage is _SEARCHING:
            self._search(start, self.true_position)
        return machine

    @property
    def undisturbed(self) -> bool:
        """Whether `show` can show each cycle: its encoder counts, is read in blocks, and it follows no master."""
        in_blocks = not self.scale.noisy or (self.enabled and not self.axis.jammed)
        return in_blocks and not (self._losing or self.axis.encoder_lost or self.superimposed)

    def _in_machine(self, track: list[float], origin: float) -> list[float]:
        """Return a track in machine counts. An axis at rest returns the same list, and so does this."""
        if track is not self._track or origin != self._origin:
            self._track, self._origin = track, origin
            self._machine = [position + origin for position in track] if origin else track
        return self._machine

    def begin_stretch(self) -> None:
        """Remember the state before a stretch of cycles."""
        self.replay.begin(self.desired, self.actual, self.scale.now)

    def keep_stretch(self, cycle_ms: float, commands: list[float] | None, corrections: list[float] | None) -> None:
        """Remember each cycle of the stretch that was just run with these, for `show`."""
        track, told = self._track, commands
        if self.enabled and commands is None:
            told = [self.desired] * len(track)
        corrected = corrections or [self.correction] * len(track)
        self.replay.keep(track, self.scale.drawn, told if self.enabled else None, corrected, cycle_ms)

    def show(self, at: int) -> None:
        """Be as after cycle `at` of the last stretch, to all that reads registers."""
        shown = self.replay.cycles[at]
        self.desired, self.velocity, self.actual, self._last_actual, self.correction, now, before = shown
        if self.scale.noisy:
            self.scale.now, self.scale.before = now, before

    def passed_index(self, before: float, after: float) -> float | None:
        """Return the home trigger position between two machine positions, if any."""
        return None if self.index_lost else self._home.find_trigger(before, after)

    def follow_master(self, counts: float) -> None:
        """Follow a master by `counts`, in closed loop and as far as the travel limits allow."""
        if not self.enabled:
            return
        if self.travel.bars(counts):
            self.travel.stopped = True
            return
        self.superimposed += counts
        self._followed_since_scan += counts

    def check(self) -> MotorFault | None:
        """Check limits, following error and position, as the background does; return an alarm to act on."""
        if not self.enabled and self._output is None:
            self._poller = 0
            return None
        guard = self.guard
        here = count_position(self.actual + self.scale.now)
        error = abs(self.desired + self.correction + self.superimposed - here) if self.enabled else 0.0
        travel = self.travel
        # A limit that is set is checked even inside Ix13 and Ix14.
        limited = travel.positive or travel.negative or travel.plus_pin or travel.minus_pin
        if limited or not guard.lowest <= here <= guard.highest:
            self._sample_travel(here, guard)
        self._poller = self._poller + 1 if self.velocity == 0.0 and self._is_settled(error, guard) else 0
        if self.fault_input and guard.fault_used:
            return MotorFault.AMPLIFIER
        if error > guard.fatal_error:
            return MotorFault.FOLLOWING_ERROR
        followed = self._followed_since_scan + self.correction - self._correction_at_scan
        self._followed_since_scan, self._correction_at_scan = 0.0, self.correction
        if not (travel.positive or travel.negative):
            return None
        heading = (self.velocity or followed) if self._output is None else self._output
        return MotorFault.TRAVEL if heading and not self.jog.aborting and travel.bars(heading) else None

    def _absorb(self) -> None:
        """Make the followed distance motion of the motor itself; a program continues from the result."""
        self.desired += self.superimposed
        self.superimposed, self.stopped_at = 0.0, None

    def _count_losses(self) -> None:
        """Freeze the reading while the encoder does not count; counts lost meanwhile stay lost."""
        lost = self.axis.encoder_lost
        if self._losing and not lost:
            missed = self.true_position - self.axis.origin - self.actual
            self.axis.rebase(missed)
            self._lost_counts += missed
        self._losing = lost

    def _sample_travel(self, here: float, guard: Guard) -> None:
        """Ignore Ix13 and Ix14 while the home trigger is being searched: the zero is not known then."""
        seeking_home = self.jog.homes and self.jog.stage is TriggerStage.SEARCHING
        highest, lowest = (inf, -inf) if seeking_home else (guard.highest, guard.lowest)
        self.travel.sample(here, highest, lowest, pins_used=guard.switches_used)

    def _is_settled(self, error: float, guard: Guard) -> bool:
        return (
            self.enabled
            and self.velocity == 0.0
            and self.jog.player is None
            and not self.program_timer
            and error < guard.in_position
        )

    def _search(self, start: float, end: float) -> None:
        """Capture the trigger, make it the home in a home search, and stop."""
        trigger = self.passed_index(start, end)
        if trigger is None:
            return
        caught = trigger - self.axis.origin
        if self.jog.homes:
            if not self.offset_following:
                self._absorb()
            self._declare_home(caught + self.variable(26) / PARTS_PER_COUNT, caught)
            caught = 0.0
        else:
            caught -= self.correction + self.superimposed
        self.jog.stop_past(caught, self.desired, self.velocity)

    def _declare_home(self, zero: float, captured: float) -> None:
        """Make `zero` the motor's zero; captured positions are kept in counts from power-up."""
        self.home_capture = captured + self.axis.origin - self._power_up_origin
        self._rebase(zero)
        self.home_complete = True

    def _rebase(self, offset: float) -> None:
        """Make `offset` the new zero; the axis does not move."""
        self.axis.rebase(offset)
        if self._averaged is not None:
            self._averaged.rebase(offset)
        self.desired -= offset
        self.actual -= offset
        self._last_actual -= offset
        self.jog.began_at -= offset
        self.stopped_at = None  # a program resumes from where the motor is, in the new counts


def _sum(commands: list[float], corrections: list[float] | None, added: float) -> list[float]:
    """Return commands with what is added to them, in each cycle or all the time."""
    if corrections is not None:
        return [commands[at] + corrections[at] for at in range(len(commands))]
    return [command + added for command in commands] if added else commands
