"""A motor of the simulated controller: its loop, its jogs and its home search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum, auto
from math import inf

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.settings import PARTS_PER_COUNT
from drivers.pmac.trajectory.jog import JogSettings, change_speed, decelerate, jog_to
from drivers.pmac.trajectory.pieces import Piece, position_at
from drivers.pmac.trajectory.planner import SHORTEST_RAMP_MS
from drivers.pmac.variables import VariableStore
from drivers.simulator.guard import Alarm, Guard, read_guard
from drivers.simulator.home_sensor import HomeSensor
from drivers.simulator.plant.encoder import read_encoder
from drivers.simulator.player import Player
from drivers.simulator.servo import Axis
from drivers.simulator.travel import TravelLimits

FULL_OUTPUT_PERCENT = 100.0


class Stage(Enum):
    """The stages of a move that looks for a trigger: a home search, or a jog until a trigger."""

    SEARCHING = auto()
    STOPPING = auto()
    LAST_MOVE = auto()


class Motor:
    """Commanded position, mode and status of one motor; `axis` is the iron behind it.

    Positions are counts from the motor's zero. What is reported, and what a jog is told, has `bias` added, by
    which PSET and its like have moved the zero of the axes. `enabled` is closed loop. `program_timer` is whether
    a coordinate system is playing a program with this motor, and `stopped_at` where a program that can be resumed
    has left it; `pre_jog` is whether it is on its way back there (J=). `fault_input` is what the amplifier says;
    somebody else sets it, as the pins of `travel`.
    """

    def __init__(self, number: int, variables: VariableStore, axis: Axis, home: HomeSensor) -> None:
        self.number = number
        self.axis = axis
        self.enabled = False
        self.home_complete = False
        self.fatal_error = False
        self.amplifier_fault = False
        self.fault_input = False
        self.desired = 0.0
        self.velocity = 0.0  # commanded, counts/ms
        self.actual = 0.0
        self.bias = 0.0
        self.home_capture = 0.0
        self.variable_jog = 0.0
        self.aborting = False
        self.trigger_move = False
        self.program_timer = False
        self.pre_jog = False
        self.stopped_at: float | None = None
        self.travel = TravelLimits()
        self._output: float | None = None
        self._last_actual = 0.0
        self._variables = variables
        self._home = home
        self._player: Player | None = None
        self._stage: Stage | None = None
        self._homes = False
        self._past_trigger = 0.0
        self._before_jog = 0.0
        self._power_up_origin = axis.origin
        self._looks = 0
        self._guard = read_guard(variables, number)
        self._guard_revision = variables.i_revision

    @property
    def activated(self) -> bool:
        """Whether Ix00 is set."""
        return self.variable(0) != 0.0

    @property
    def amplifier_enabled(self) -> bool:
        """Whether the amplifier is on: in closed loop, or with an open-loop output."""
        return self.enabled or self._output is not None

    @property
    def open_loop_output(self) -> bool:
        """Whether the amplifier is on, with an output that O has set."""
        return self._output is not None

    @property
    def encoder(self) -> float:
        """Actual position as the encoder counts it."""
        return float(read_encoder(self.actual))

    @property
    def position(self) -> float:
        """Actual position as it is reported."""
        return read_encoder(self.actual) + self.bias

    @property
    def encoder_step(self) -> float:
        """Actual velocity in counts per servo cycle."""
        return self.encoder - read_encoder(self._last_actual)

    @property
    def following_error(self) -> float:
        """Commanded minus actual position in counts; 0 in open loop."""
        return self.desired - self.encoder if self.enabled else 0.0

    @property
    def warning(self) -> bool:
        """Whether the following error is above Ix12, or was when it killed the motor."""
        return self.fatal_error or abs(self.following_error) > self.guard.warning_error

    @property
    def positive_limit(self) -> bool:
        """Whether travel in the positive direction is barred. Not looked at while the amplifier is off."""
        return self.travel.positive

    @property
    def negative_limit(self) -> bool:
        """Whether travel in the negative direction is barred. Not looked at while the amplifier is off."""
        return self.travel.negative

    @property
    def stopped_on_limit(self) -> bool:
        """Whether a limit has stopped the motor since its last move began."""
        return self.travel.stopped

    @property
    def jogging(self) -> bool:
        """Whether a jog or a home search is being played."""
        return self._player is not None

    @property
    def homing(self) -> bool:
        """Whether a home search is under way, its last move included."""
        return self._stage is not None and self._homes

    @property
    def searching(self) -> bool:
        """Whether a trigger is being looked for and not yet found."""
        return self._stage is Stage.SEARCHING

    @property
    def in_position(self) -> bool:
        """Closed loop, at rest, no program timer, and within Ix28, for as many scans as are asked for."""
        guard = self.guard
        return self._looks > guard.looks and self._settled(abs(self.following_error), guard)

    @property
    def guard(self) -> Guard:
        """The settings that are watched, as they stand."""
        revision = self._variables.i_revision
        if revision != self._guard_revision:
            self._guard, self._guard_revision = read_guard(self._variables, self.number), revision
        return self._guard

    def variable(self, number: int) -> float:
        """Return Ix`number` of this motor."""
        return self._variables.motor(self.number, number)

    def run(self, cycles: int, cycle_ms: float, commands: Sequence[float] | None) -> list[float]:
        """Run a block; `commands` come from a coordinate system, None means the motor's own jog.

        Returns:
            The true machine position (counts) at each servo cycle.
        """
        if not self.enabled:
            track = self.axis.coast(cycles) if self._output is None else self.axis.push(self._output, cycles)
            self.desired, self.velocity = float(read_encoder(track[-1])), 0.0
        else:
            commands = self._own_commands(cycles, cycle_ms) if commands is None else commands
            track = self.axis.follow(commands)
            before = commands[-2] if cycles > 1 else self.desired
            self.desired, self.velocity = commands[-1], (commands[-1] - before) / cycle_ms
        self._last_actual = track[-2] if cycles > 1 else self.actual
        start, self.actual = self.actual + self.axis.origin, track[-1]
        origin = self.axis.origin
        machine = [position + origin for position in track] if origin else track
        if self._stage is Stage.SEARCHING:
            self._search(start, machine[-1])
        return machine

    def look(self) -> Alarm | None:
        """Look at limits, following error and position, as the background does; say what calls for action."""
        if not self.enabled and self._output is None:
            self._looks = 0
            return None
        guard = self.guard
        here = read_encoder(self.actual)
        error = abs(self.desired - here) if self.enabled else 0.0
        travel = self.travel
        if not guard.lowest <= here <= guard.highest or travel.concerned:
            self._look_at_travel(here, guard)
        self._looks = self._looks + 1 if self._settled(error, guard) else 0
        if self.fault_input and guard.fault_used:
            return Alarm.AMPLIFIER
        if error > guard.fatal_error:
            return Alarm.FOLLOWING_ERROR
        heading = self.velocity if self._output is None else self._output
        if heading and not self.aborting and travel.bars(heading):
            return Alarm.TRAVEL
        return None

    def enable(self) -> None:
        """Close the loop where the motor stands."""
        if not self.enabled:
            self.enabled = True
            self._output = None
            self.fatal_error = self.amplifier_fault = False
            self.desired, self.velocity = self.axis.close_loop(), 0.0
            self._look_at_travel(self.encoder, self.guard)

    def kill(self) -> None:
        """Open the loop; the axis coasts."""
        self.enabled = False
        self._output = None
        self._forget_motion()

    def reset(self) -> None:
        """Start as at power-up: killed, not homed, and at position 0 wherever the iron is."""
        self.read_absolute_position()
        self.fatal_error = self.amplifier_fault = False
        self.home_capture = self.variable_jog = 0.0
        self.stopped_at = None
        self.travel.reset()
        self._power_up_origin = self.axis.origin

    def read_absolute_position(self) -> None:
        """Take the present place for 0, killed and not homed: there is no absolute encoder to ask."""
        self.kill()
        self.home_complete = False
        self._rebase(self.encoder)
        self.bias = 0.0

    def phase(self) -> None:
        """`$`: there is nothing to phase; the loop is closed where the motor stands.

        Raises:
            PmacError: 018, the motor moves.
        """
        if self.velocity or self.jogging:
            raise PmacError(ErrorCode.PHASE_REFERENCE, f"#{self.number} moves")
        self.enable()

    def open_loop(self, percent: float) -> None:
        """Open the loop and hold the output at `percent` of Ix69, at most all of it, as on the card."""
        share = max(-FULL_OUTPUT_PERCENT, min(percent, FULL_OUTPUT_PERCENT)) / FULL_OUTPUT_PERCENT
        self._forget_motion()
        self.enabled = False
        self.fatal_error = self.amplifier_fault = False
        self._look_at_travel(self.encoder, self.guard)
        self.travel.stopped = self.travel.bars(share)
        self._output = 0.0 if self.travel.stopped else share

    def jog_speed(self, direction: int) -> None:
        """Jog for ever in `direction`; 0 stops, and closes the loop of a killed motor."""
        self.enable()
        if self._barred(direction):
            return
        speed = direction * abs(self.variable(22))
        if not speed and not self.velocity:
            self._play(())
            return
        pieces = change_speed(self.desired, self.velocity, speed, self._jog_settings())
        self._play((*pieces, *_for_ever(pieces[-1], speed)) if speed else pieces)

    def jog_to(self, position: float, past_trigger: float | None = None) -> None:
        """Jog to a reported position in counts, after a stop when the motor moves.

        With `past_trigger`, the motor stops when it meets the home trigger and goes so many counts past it.
        """
        self._jog(position - self.bias, past_trigger)

    def jog_by(self, distance: float, from_actual: bool = False, past_trigger: float | None = None) -> None:
        """Jog by `distance` counts from the commanded position, or from the actual one."""
        self.enable()
        self._jog((self.encoder if from_actual else self.desired) + distance, past_trigger)

    def jog_back(self) -> None:
        """Jog to where a stopped program left the motor, or else to where it stood before its last jog."""
        self._jog(self._before_jog if self.stopped_at is None else self.stopped_at, None)
        self.pre_jog = self.jogging and not self.travel.stopped

    def home(self) -> None:
        """Search the home trigger at Ix23; Ix13 and Ix14 mean nothing until it is found."""
        self.enable()
        speed = self.variable(23)
        self.home_complete = False
        self.travel.look(self.encoder, inf, -inf, pins_used=self.guard.switches_used)
        if self._barred(speed):
            return
        pieces = change_speed(self.desired, self.velocity, speed, self._jog_settings())
        self._play((*pieces, *_for_ever(pieces[-1], speed)))
        self._seek(homes=True, past_trigger=0.0)

    def home_zero(self) -> None:
        """Call the present place home without a move; the following error stays what it is."""
        here = self.desired if self.enabled else self.encoder
        self._forget_motion()
        self._declare_home(here, here)

    def abort(self) -> None:
        """Come to rest at Ix15; an open loop is closed."""
        self.enable()
        pieces = decelerate(self.desired, self.velocity, self.variable(15))
        self._play(pieces)
        self.aborting = bool(pieces)

    def stop_on_limit(self) -> None:
        """Come to rest at Ix15, or take an open-loop output away, because there is no way further."""
        if self.enabled:
            self.abort()
        else:
            self._output = 0.0
        self.travel.stopped = True

    def _jog(self, target: float, past_trigger: float | None) -> None:
        self.enable()
        if self._barred(target - self.desired):
            return
        settings = self._jog_settings()
        pieces: tuple[Piece, ...] = ()
        start = self.desired
        if self.velocity:
            pieces = change_speed(self.desired, self.velocity, 0.0, settings)
            start = position_at(pieces[-1].cubics[0], pieces[-1].duration_ms)
        self._play((*pieces, *jog_to(start, target, settings)))
        if past_trigger is not None and self._player is not None:
            self._seek(homes=False, past_trigger=past_trigger)

    def _barred(self, direction: float) -> bool:
        """Whether a limit lets the motor not go there. It stops, or stays, and that is all that the card says."""
        barred = self.travel.bars(direction)
        self.travel.stopped = barred or (self.travel.stopped and not direction)
        if barred and self.velocity:
            self._play(change_speed(self.desired, self.velocity, 0.0, self._jog_settings()))
        return barred

    def _look_at_travel(self, here: float, guard: Guard) -> None:
        """Ix13 and Ix14 rest while the home trigger is being searched: where zero is, is not known then."""
        free = self._stage is Stage.SEARCHING and self._homes
        highest, lowest = (inf, -inf) if free else (guard.highest, guard.lowest)
        self.travel.look(here, highest, lowest, pins_used=guard.switches_used)

    def _settled(self, error: float, guard: Guard) -> bool:
        return (
            self.enabled
            and self.velocity == 0.0
            and self._player is None
            and not self.program_timer
            and error < guard.in_position
        )

    def _own_commands(self, cycles: int, cycle_ms: float) -> list[float]:
        if self._player is None:
            return [self.desired] * cycles
        commands = self._player.sample(cycles, cycle_ms)[0]
        if self._player.idle:
            self._player = None
            self.aborting = self.pre_jog = False
            self._next_stage(commands[-1])
        return commands

    def _seek(self, *, homes: bool, past_trigger: float) -> None:
        self._stage = Stage.SEARCHING
        self._homes, self._past_trigger = homes, past_trigger
        self.trigger_move = True

    def _search(self, start: float, end: float) -> None:
        """Capture the trigger, make it the home where it is one, and stop."""
        trigger = self._home.passed(start, end)
        if trigger is None:
            return
        caught = trigger - self.axis.origin
        if self._homes:
            self._declare_home(caught + self.variable(26) / PARTS_PER_COUNT, caught)
            caught = 0.0
        homes, goal = self._homes, caught + self._past_trigger
        self._play(change_speed(self.desired, self.velocity, 0.0, self._jog_settings()) if self.velocity else ())
        self._stage, self._homes, self._past_trigger = Stage.STOPPING, homes, goal
        self.trigger_move = True
        if self._player is None:
            self._next_stage(self.desired)

    def _next_stage(self, position: float) -> None:
        """Go on with what follows when a move has ended: past the trigger, and then nothing."""
        if self._stage is Stage.STOPPING:
            self._stage = Stage.LAST_MOVE
            pieces = jog_to(position, self._past_trigger, self._jog_settings())
            if pieces:
                self._player = Player((position,))
                self._player.append(pieces)
                return
        # A jog that met no trigger ends with the bit still set, so that the host can tell (User Manual).
        self.trigger_move = self._stage is Stage.SEARCHING
        self._stage = None

    def _declare_home(self, zero: float, captured: float) -> None:
        """Make `zero` the motor's zero; what was captured is kept in counts from power-up."""
        self.home_capture = captured + self.axis.origin - self._power_up_origin
        self._rebase(zero)
        self.home_complete = True

    def _rebase(self, offset: float) -> None:
        """Make `offset` the new zero; the iron does not move."""
        self.axis.rebase(offset)
        self.desired -= offset
        self.actual -= offset
        self._last_actual -= offset

    def _play(self, pieces: tuple[Piece, ...]) -> None:
        if self._player is None:
            self._before_jog = self.desired
        self._forget_motion()
        if not pieces:
            return
        self._player = Player((self.desired,))
        self._player.append(pieces)

    def _forget_motion(self) -> None:
        self._player = None
        self._stage = None
        self.trigger_move = False
        self.aborting = self.pre_jog = False

    def _jog_settings(self) -> JogSettings:
        ta_ms, ts_ms = (float(max(0, math.floor(self.variable(n) + 0.5))) for n in (20, 21))
        return JogSettings(
            acceleration=self.variable(19),
            ta_ms=ta_ms or (0.0 if ts_ms else SHORTEST_RAMP_MS),
            ts_ms=ts_ms,
            speed=abs(self.variable(22)),
        )


def _for_ever(last: Piece, speed: float) -> tuple[Piece, ...]:
    """Return what follows `last` at constant speed (counts/ms)."""
    end = position_at(last.cubics[0], last.duration_ms)
    return (Piece(float("inf"), ((end, speed, 0.0, 0.0),)),)
