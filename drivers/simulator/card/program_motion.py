"""The motion of a program: calculated one move ahead, played, stopped and resumed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from copy import copy

from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.requests import DeferredValue, Halt, HomeRequest, PresetRequest, TriggerRequest
from drivers.pmac.settings import I10_PER_MS
from drivers.pmac.trajectory.circle import CircleRadiusError
from drivers.pmac.trajectory.pieces import Piece, Vector
from drivers.pmac.trajectory.planned_pieces import Event
from drivers.pmac.trajectory.planner import MotionPlanner
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.axis_frame import AxisFrame
from drivers.simulator.card.motor import Motor
from drivers.simulator.card.player import Player

Place = tuple[int, int]  # a program and a line in it
REAL_TIME_PERCENT = 100.0
_OVERRIDE_SLEW, _HOLD_SLEW = 94, 95  # Ix94 and Ix95: maximum change of the time base per servo cycle, 2^-23 ms
_WIDEST = I10_PER_MS - 1  # the time base is a signed 24-bit word, a servo cycle's worth in 2^-23 ms


class TimeBase:
    """The commanded time base, the effect of a feed hold, and the value that slews between them.

    The command is `%`, or the source that Ix93 names instead, anew in each servo cycle. `percent` is the present
    value; at 100 a servo cycle is a servo cycle, as I10 states it. `real_time` is whether that is so and stays so.
    A feed hold and the start after it slew at Ix95, everything else at Ix94.
    """

    def __init__(self, system: int, variables: VariableStore) -> None:
        self.percent = REAL_TIME_PERCENT
        self.holding = False
        self.real_time = True
        self._override = REAL_TIME_PERCENT
        self._led: float | None = None
        self._resuming = False
        self._system = system
        self._variables = variables

    @property
    def led(self) -> bool:
        """Whether another source than `%` sets the rate of time."""
        return self._led is not None

    @property
    def steady(self) -> bool:
        """Whether the present value equals the commanded one."""
        return self.percent == self._goal

    @property
    def stopped(self) -> bool:
        """Whether no trajectory time passes, nor will without another command."""
        return self.percent == 0.0 and self._goal == 0.0

    @property
    def _goal(self) -> float:
        if self.holding:
            return 0.0
        return self._override if self._led is None else self._led

    def set_override(self, percent: float) -> None:
        """Command another rate, up to the controller's maximum. Raises PmacError: 003, not a number from 0."""
        if not (math.isfinite(percent) and percent >= 0.0):
            raise PmacError(ErrorCode.DATA_ERROR, f"%{percent}; from 0")
        self._override = min(percent, REAL_TIME_PERCENT * _WIDEST / self._units())
        self._note()

    def lead(self, units: int | None) -> None:
        """Take the source's value for this servo cycle, 2^-23 ms; None returns the command to `%`."""
        self._led = None if units is None else REAL_TIME_PERCENT * units / self._units()
        self._note()

    def hold(self) -> None:
        """Slew to a stop."""
        self.holding, self._resuming = True, False
        self._note()

    def release(self) -> None:
        """Slew back to the `%` command, after a feed hold."""
        self._resuming = self._resuming or self.holding
        self.holding = False
        self._note()

    def restart(self) -> None:
        """Clear a hold when the motion is over: the next one begins at the `%` command."""
        if self.holding or self._resuming:
            self.holding = self._resuming = False
            self.percent = self._goal
            self._note()

    def reset(self) -> None:
        """Return to real time, as at power-up."""
        self.holding = self._resuming = False
        self.percent = self._override = REAL_TIME_PERCENT
        self._led = None
        self._note()

    def play(self, player: Player, cycles: int, cycle_ms: float) -> list[list[float]]:
        """Return a block of positions for each motor at this rate, cycle by cycle while it changes."""
        if self.steady:
            return player.sample(cycles, cycle_ms, cycle_ms * (self.percent / REAL_TIME_PERCENT))
        tracks: list[list[float]] = [[] for _ in player.position]
        for _ in range(cycles):
            self.advance(1)
            sampled = player.sample(1, cycle_ms, cycle_ms * (self.percent / REAL_TIME_PERCENT))
            for track, (position,) in zip(tracks, sampled, strict=True):
                track.append(position)
        return tracks

    def advance(self, cycles: int) -> None:
        """Slew for so many servo cycles."""
        slew = _HOLD_SLEW if self.holding or self._resuming else _OVERRIDE_SLEW
        units = max(0.0, self._variables.system(self._system, slew))
        most = cycles * units * REAL_TIME_PERCENT / self._units()
        change = self._goal - self.percent
        if abs(change) <= most:
            self.percent = self._goal
            self._resuming = False
        else:
            self.percent += math.copysign(most, change)
        self._note()

    def _note(self) -> None:
        self.real_time = self._led is None and self.steady and self.percent == REAL_TIME_PERCENT

    def _units(self) -> int:
        """A servo cycle as I10 states it, in 2^-23 ms."""
        return max(1, int(self._variables.i(10)) % I10_PER_MS)


class ProgramMotion:
    """The program that moves the motors of a coordinate system, or has moved them until it was stopped.

    It is `running` while moves are still to be calculated. `single_step` stops it after the next one.
    `executing_at` is the line being played, `homing` are the motors that move by themselves, in a HOME or until a
    trigger. The planner is kept as long as the program can be resumed: up to its end, a run-time error, or another
    program being pointed at. Calculated motion is played to its end without it.
    """

    def __init__(
        self,
        system: int,
        variables: VariableStore,
        motors: Mapping[int, Motor],
        frame: AxisFrame,
        time_base: TimeBase,
    ) -> None:
        """Take `motors`, all of the controller, for HOME; those of the axes are in `frame`."""
        self.running = False
        self.single_step = False
        self.runtime_error = False
        self.radius_error = False
        self.executing_at: Place = (0, 0)
        self.system = system
        self._variables = variables
        self._motors = motors
        self._frame = frame
        self._time_base = time_base
        self._planner: MotionPlanner | None = None
        self._player: Player | None = None
        self._event: Event | None = None
        self._newest: tuple[Piece, ...] = ()
        self.homing: tuple[Motor, ...] = ()
        self._seeks_homes = True

    @property
    def moving(self) -> bool:
        """Whether calculated motion is still being played."""
        return self._player is not None or bool(self.homing)

    @property
    def held_at(self) -> Vector | None:
        """Position at which a feed hold has brought the motion to rest, counts; the motors may be jogged then."""
        player = self._player
        return (
            player.position if player is not None and self._time_base.holding and self._is_frozen(player) else None
        )

    @property
    def dwelling(self) -> bool:
        """Whether a DWELL is under way."""
        return self._player is not None and self._player.in_real_time

    @property
    def left_ms(self) -> float:
        """How long the piece of motion that is played still takes at real-time speed; 0 at rest."""
        return 0.0 if self._player is None else self._player.left_ms

    @property
    def resumable(self) -> bool:
        """Whether there is a program to resume."""
        return self._planner is not None

    @property
    def calculated_at(self) -> Place | None:
        """The program and the line that are calculated next, None when there is nothing to resume."""
        return None if self._planner is None else (self._planner.run.program, self._planner.run.line)

    def load(self, run: ProgramRun) -> None:
        """Take a program at its beginning."""
        frame = self._frame
        self._planner = MotionPlanner(run, frame.shifted_definitions, self._variables, frame.places, self.system)

    def begin(self, stepping: bool) -> None:
        """Let the program move the motors, from rest; `stepping` is for one move."""
        self._time_base.restart()
        for motor in self._frame.motors:
            motor.program_timer = True
            motor.travel.stopped = False
        self._frame.stopped_at = None
        self._play()
        self.running, self.single_step = True, stepping
        self.runtime_error = self.radius_error = False

    def release(self, stepping: bool) -> None:
        """Resume after a feed hold; a single step that was held stays one."""
        self._time_base.release()
        self._frame.stopped_at = None
        self.single_step = stepping or (self.single_step and not self.running)

    def quit(self) -> None:
        """Calculate no further move; the calculated motion is played, then the motors stop."""
        if not self.running:
            return
        self.running, self.single_step = False, True
        if self._player is not None:
            self._player.append(self._halt())

    def take_back(self) -> bool:
        """Stop before the move that was calculated last; False when it is too late for that."""
        if not self.running or self._planner is None or self._player is None:
            return False
        planner = copy(self._planner)
        try:
            if not planner.take_back() or not self._player.replace(self._newest, planner.settle()):
                return False
        except PmacError:
            return False
        self._planner, self._event, self.running = planner, None, False
        return True

    def forget_debt(self) -> None:
        """Continue the motion from its present state, whatever time was taken back."""
        if self._player is not None:
            self._player.forget_debt()

    def drop(self) -> None:
        """Release the motors at their present positions; the program can be resumed from where they rest."""
        self._event, self.homing = None, ()
        self.running = False
        self._rest(None)

    def reset(self) -> None:
        """Clear everything, as at power-up."""
        self.drop()
        self.forget()
        self.runtime_error = self.radius_error = self.single_step = False

    def forget(self) -> None:
        """Calculate nothing more of this program."""
        self._planner = self._frame.stopped_at = None

    def preset(self, presets: Mapping[str, float]) -> None:
        """Preset axes (user units); a program continues from there. Raises PmacError: 003, no such axis here."""
        self._frame.preset(presets)
        self.relocate()

    def relocate(self) -> None:
        """Let the program continue from the present motor positions and axis origins."""
        if self._planner is not None:
            self._planner.run.relocate(self._frame.positions())
            self._planner.relocate(self._frame.places, self._frame.shifted_definitions)

    def sample(self, cycles: int, cycle_ms: float) -> dict[int, list[float]]:
        """Return the commands of a block by motor number, nothing when no motion is being played."""
        if self._event is not None:
            self._carry_out(self._event)
        player = self._player
        if player is not None and self._time_base.real_time:
            tracks = player.sample(cycles, cycle_ms)
        elif player is None or self._is_frozen(player):
            # Time passes: home searches of the program, a hold, or nothing at all.
            self._time_base.advance(cycles)
            self._wait_for_homes()
            if player is not None and self._time_base.holding:
                self._frame.stopped_at = player.position  # J= returns to here
            return {}
        else:
            tracks = self._time_base.play(player, cycles, cycle_ms)
        if player.idle and self._event is None and not self.running:
            self._rest(player.position)
        return self._by_motor(tracks)

    def uneventful(self, cycle_ms: float) -> int:
        """Return for how many servo cycles a piece of motion is certain to continue in real time; else 1."""
        player = self._player
        return 1 if player is None or not self._time_base.real_time else player.whole_cycles(cycle_ms)

    def sample_singly(self, cycles: int, cycle_ms: float) -> dict[int, list[float]]:
        """Return what `sample` would in so many calls for one cycle each, no more than `uneventful`."""
        assert self._player is not None
        tracks = self._player.sample_singly(cycles, cycle_ms)
        return self._by_motor(tracks)

    def _by_motor(self, tracks: list[list[float]]) -> dict[int, list[float]]:
        return {motor.number: tracks[at] for at, motor in enumerate(self._frame.motors)}

    def _is_frozen(self, player: Player) -> bool:
        return self._time_base.stopped and not player.in_real_time

    def _play(self) -> None:
        self._player = Player(self._frame.places, self._refill, self._assign)

    def _refill(self) -> Iterable[Piece]:
        planner = self._planner
        if planner is None or not self.running or self._event is not None:
            return ()
        run = planner.run
        self.executing_at = run.program, run.line
        run.single_step = self.single_step
        try:
            planned = planner.plan()
            pieces = planned.pieces
            if planned.finished:
                self.running, self._planner = False, None
            elif self.single_step and not run.in_block:
                pieces += planner.settle()
                self.running = False
        except PmacError as failed:
            self.radius_error = isinstance(failed, CircleRadiusError)
            return self._fail()
        self._event, self._newest = planned.event, pieces
        return pieces

    def _assign(self, deferred: tuple[DeferredValue, ...]) -> None:
        try:
            for each in deferred:
                self._variables.set(each.kind, each.index, each.value, self.system)
        except PmacError:
            pieces = self._fail()
            if self._player is not None:
                self._player.append(pieces)

    def _fail(self) -> tuple[Piece, ...]:
        """End the program with a run-time error; return the pieces that bring the motors to rest."""
        pieces = self._halt()
        self.running, self.runtime_error, self._planner = False, True, None
        return pieces

    def _halt(self) -> tuple[Piece, ...]:
        if self._planner is None:
            return ()
        return self._planner.halt(tuple(motor.variable(15) for motor in self._frame.motors))

    def _carry_out(self, event: Event) -> None:
        """Execute the event that waits for the motion before it, once that is played and the motors stand."""
        player = self._player
        if player is None or not player.idle:
            return
        self._event = None
        match event:
            case HomeRequest():
                self._seek_homes(event)
                return
            case TriggerRequest():
                self._seek_triggers(event)
                return
            case PresetRequest():
                axes = self._frame.positions()
                self.preset({axis: place for axis, place in event.positions.items() if axis in axes})
            case Halt():
                self.running = False
        if not self.running:
            self._rest(player.position)

    def _seek_homes(self, request: HomeRequest) -> None:
        """HOME in a program: the motors move by themselves until all of them are done."""
        self._player = None
        motors = tuple(self._motors[number] for number in request.motors if number in self._motors)
        taken = [motor for motor in motors if motor.program_timer and motor not in self._frame.motors]
        if len(motors) < len(request.motors) or taken or not all(motor.activated for motor in motors):
            self._fail()
            return self._rest(None)
        for motor in motors:
            (motor.home_zero if request.zero else motor.home)()
        self.homing, self._seeks_homes = motors, True

    def _seek_triggers(self, request: TriggerRequest) -> None:
        """A move until a trigger: the motors move by themselves until all of them are done."""
        self._player = None
        moving = [d for d in self._frame.shifted_definitions if not request.moving.isdisjoint(d.axes)]
        for definition in moving:
            triggered = not request.past_trigger.keys().isdisjoint(definition.axes)
            past = definition.distance(request.past_trigger) if triggered else None
            motor = self._motors[definition.motor]
            motor.jog_to(definition.counts(request.targets) + motor.bias, past)
        self.homing, self._seeks_homes = tuple(self._motors[d.motor] for d in moving), False

    def _wait_for_homes(self) -> None:
        if not self.homing or any(motor.jogging for motor in self.homing):
            return
        homed = not self._seeks_homes or all(motor.home_complete for motor in self.homing)
        self.homing = ()
        if not homed or self._planner is None:
            self._fail()
            return self._rest(None)
        self.relocate()
        if self.running:
            self._play()
        else:
            self._rest(self._frame.places)

    def _rest(self, position: Vector | None) -> None:
        """End the motion; `position` is where a stopped program has to resume, None for anywhere."""
        self._player = None
        self._time_base.restart()
        for motor in self._frame.motors:
            motor.program_timer = False
        self._frame.stopped_at = position if self.resumable else None
