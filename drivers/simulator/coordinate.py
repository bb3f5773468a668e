"""A coordinate system of the simulated controller: axis definitions and the program that it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import cache

from drivers.pmac.axes import AxisDefinition
from drivers.pmac.dialect import Setting
from drivers.pmac.execution.modes import Modes
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.structure import Code
from drivers.pmac.requests import Deferred, Halt, HomeRequest, PresetRequest, ProgramHost
from drivers.pmac.trajectory.circle import CircleRadiusError
from drivers.pmac.trajectory.pieces import Piece, Vector
from drivers.pmac.trajectory.planned import Event
from drivers.pmac.trajectory.planner import MotionPlanner
from drivers.pmac.variables import VariableStore
from drivers.simulator.axis_frame import AxisFrame
from drivers.simulator.motor import Motor
from drivers.simulator.permission import refuse_moved, refuse_unfit
from drivers.simulator.player import Player
from drivers.simulator.time_base import TimeBase

Library = Callable[[int], Code | None]
Place = tuple[int, int]
"""A program and a line in it."""


class CoordinateSystem:
    """Which motors move together, and the program that moves them.

    A program is `running` while moves of it are still to be calculated, and `moving` until they are played. When
    it was stopped on the way (Q, S, STOP, A and the like) it can be resumed, until something else is pointed at.
    `busy` is whether a block of servo cycles concerns the system at all.
    """

    def __init__(
        self,
        number: int,
        variables: VariableStore,
        motors: Mapping[int, Motor],
        library: Library,
        host: ProgramHost,
    ) -> None:
        self.number = number
        self.frame = AxisFrame(motors)
        self.program_number: int | None = None
        self.modes = Modes()
        self.time_base = TimeBase(number, variables)
        self.running = False
        self.single_step = False
        self.end_of_block_stop = False
        self.program_hold = False
        self.runtime_error = False
        self.radius_error = False
        self.resume_error = False
        self.busy = False
        self._variables = variables
        self._motors = motors
        self._library = library
        self._host = host
        self._label: int | None = None
        self._run: ProgramRun | None = None
        self._run_number: int | None = None
        self._planner: MotionPlanner | None = None
        self._player: Player | None = None
        self._resume_from: Vector | None = None
        self._event: Event | None = None
        self._newest: tuple[Piece, ...] = ()
        self._homing: tuple[Motor, ...] = ()
        self._executing_at: Place = (0, 0)

    @property
    def moving(self) -> bool:
        """Whether calculated motion is still being played."""
        return self._player is not None or bool(self._homing)

    @property
    def held(self) -> bool:
        """Whether a feed hold has brought the motion to rest; the motors may be jogged then."""
        player = self._player
        return player is not None and self.time_base.holding and self._frozen(player)

    @property
    def dwelling(self) -> bool:
        """Whether a DWELL is under way."""
        return self._player is not None and self._player.in_real_time

    @property
    def homing(self) -> bool:
        """Whether a HOME of the program is under way."""
        return bool(self._homing)

    @property
    def in_control(self) -> bool:
        """Whether the motors are the program's: nobody else may move them."""
        return (self.running or self.moving) and not self.held

    @property
    def definitions(self) -> Mapping[int, AxisDefinition]:
        """The axis definitions by motor."""
        return self.frame.definitions

    @property
    def motors(self) -> tuple[Motor, ...]:
        """The motors of this system, in the order of their numbers."""
        return self.frame.motors

    @property
    def override_percent(self) -> float:
        """The time base as it is now, 100 for real time."""
        return self.time_base.percent

    def set_override(self, percent: float) -> None:
        """`%`: ask for another time base.

        Raises:
            PmacError: 003, below 0.
        """
        self.time_base.set_override(percent)
        self.busy = True

    def define(self, motor: int, definition: AxisDefinition | None) -> None:
        """Assign a motor to its axes, or clear it."""
        self._forget_run()
        self.frame.define(motor, definition)

    def point(self, program: int, label: int | None = None) -> None:
        """B: the next R begins there.

        Raises:
            PmacError: 001, a program runs.
        """
        if self.running:
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{self.number} runs a program")
        self._forget_run()
        self.program_number, self._label = program, label

    def run(self) -> None:
        """R: run the program, go on where it was stopped, or go on after a feed hold.

        Raises:
            PmacError: 001 something runs, 010 both limits, 011 the stop is not yet done, 012 a motor is open
                loop, 013 not activated, 014 no motors, 015 no program, 009 or 016 a program that is not well
                formed, 017 a motor was moved since the stop.
        """
        self._go(stepping=False)

    def step(self) -> None:
        """S: the same for one move, or for what stands between BLOCKSTART and BLOCKSTOP.

        Raises:
            PmacError: as for `run`.
        """
        self._go(stepping=True)

    def quit(self) -> None:
        """Q: calculate no further move; what is calculated is played, then the motors stop."""
        if not self.running:
            return
        self.running, self.single_step = False, True
        if self._player is not None:
            self._player.append(self._halt())

    def stop_at_block(self) -> None:
        """`/`: stop at the end of the move that is played, where moves are segmented; otherwise as Q does."""
        self.end_of_block_stop = self.running
        segmented = self._variables.setting(Setting.SEGMENT_MS, self.number) > 0.0
        if self.running and segmented and self._take_back():
            self.running = False
        else:
            self.quit()

    def hold(self) -> None:
        """H: let the time base go to 0 at Ix95."""
        self.time_base.hold()
        self.busy = True

    def quick_hold(self) -> None:
        """Hold the program (backslash): the same, there being no buffer of segments to stop in."""
        self.program_hold = self.running or self.moving
        self.hold()

    def abort(self, closing: bool = True) -> None:
        """Drop the motion; each motor ramps down by itself, and `closing` closes the loops that are open."""
        self.kill()
        for motor in self.motors:
            if closing or motor.enabled:
                motor.abort()

    def kill(self) -> None:
        """Drop the motion; the motors are somebody else's to stop."""
        self._event, self._homing = None, ()
        self.running = False
        self._rest(None)

    def reset(self) -> None:
        """Forget everything, as at power-up."""
        self.kill()
        self._forget_run()
        self.frame.clear()
        self.program_number = self._label = None
        self.modes = Modes()
        self.time_base.reset()
        self.runtime_error = self.radius_error = self.resume_error = False
        self.single_step = self.end_of_block_stop = self.program_hold = False

    def match_positions(self) -> None:
        """PMATCH: take the axes to be where the motors are; a stopped program goes on from there.

        Raises:
            PmacError: 001, a program moves them.
        """
        self._refuse_moving()
        self._resume_from = None
        for motor in self.motors:
            motor.stopped_at = None

    def set_axis(self, axis: str, position: float) -> None:
        """`X=5`: call the present place of an axis so (user units); nothing moves.

        Raises:
            PmacError: 001 a program moves, 003 no such axis here.
        """
        self._refuse_moving()
        self._preset({axis: position})

    def zero_axis(self, axis: str) -> None:
        """Call the present place of an axis zero.

        Raises:
            PmacError: as for `set_axis`.
        """
        self.set_axis(axis, 0.0)

    def zero_axes(self) -> None:
        """Z: call the present place of every axis zero.

        Raises:
            PmacError: 001, a program moves them.
        """
        self._refuse_moving()
        self._preset(dict.fromkeys(self.frame.positions(), 0.0))

    def program_counter(self) -> Place:
        """PC: the program and the line that are calculated next."""
        if self._run is None:
            return self.program_number or 0, 0
        return self._run.program, self._run.line

    def executing(self) -> Place:
        """PE: the program and the line that are moved by now."""
        return self._executing_at if self.moving else self.program_counter()

    def sample(self, cycles: int, cycle_ms: float) -> dict[int, list[float]]:
        """Return the commands of a block by motor number, nothing when no motion of a program is being played."""
        if self._event is not None:
            self._carry_out(self._event)
        player = self._player
        if player is not None and self.time_base.real_time:
            tracks = player.sample(cycles, cycle_ms)
        elif player is None or self._frozen(player):
            self._stand(player, cycles)
            return {}
        else:
            tracks = self.time_base.play(player, cycles, cycle_ms)
        if player.idle and self._event is None and not self.running:
            self._rest(player.position)
        return {motor.number: track for motor, track in zip(self.frame.motors, tracks, strict=True)}

    def _stand(self, player: Player | None, cycles: int) -> None:
        """Let time pass in which no motion is played: home searches of a program, a hold, or nothing at all."""
        self.time_base.advance(cycles)
        self._wait_for_homes()
        if player is not None and self.time_base.holding:
            for motor, position in zip(self.motors, player.position, strict=True):
                motor.stopped_at = position  # J= leads back to here
        self.busy = self.moving or not self.time_base.steady

    def _go(self, stepping: bool) -> None:
        motors = self.motors
        self._refuse_unfit()
        self.resume_error = False
        if self.time_base.holding and self.moving:
            self._refuse_moved(self._player.position if self._player is not None and self.held else None)
            self.time_base.release()
            self.program_hold = False
            for motor in motors:
                motor.stopped_at = None
            self.single_step = stepping or (self.single_step and not self.running)
            self.busy = True
            return
        if self.moving and not self.running and self._run is not None:
            raise PmacError(ErrorCode.MOVE_NOT_COMPLETED, f"&{self.number} is not yet at rest")
        if self.running or self.moving or any(motor.jogging for motor in motors):
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{self.number} is moving")
        if self.program_number is None:
            raise PmacError(ErrorCode.NO_PROGRAM, f"&{self.number} points to no program")
        if self._run is None or self._run_number != self.program_number:
            self._start()
        else:
            self._refuse_moved(self._resume_from)
            if self._resume_from is None:
                self._relocate()
        self.single_step = stepping
        self.end_of_block_stop = self.program_hold = False
        self._begin(motors)

    def _refuse_unfit(self) -> None:
        if not self.motors:
            raise PmacError(ErrorCode.NO_MOTORS, f"&{self.number}")
        # That something runs is what the host has to know first, whatever is wrong with the motors.
        if self.time_base.holding or not self.in_control:
            refuse_unfit(self.motors)

    def _refuse_moved(self, stopped: Vector | None) -> None:
        try:
            if stopped is not None:
                refuse_moved(self.motors, stopped)
        except PmacError:
            self.resume_error = True
            raise

    def _start(self) -> None:
        assert self.program_number is not None
        code = self._library(self.program_number)
        if code is None:
            raise PmacError(ErrorCode.NO_PROGRAM, f"program {self.program_number}")
        self._run = ProgramRun(
            code,
            self._variables,
            self.modes,
            self.frame.positions(),
            self.number,
            strict=False,
            library=cache(self._library),
            host=self._host,
            label=self._label,
            number=self.program_number,
        )
        frame = self.frame
        self._planner = MotionPlanner(self._run, frame.shifted, self._variables, frame.places, self.number)
        self._run_number, self._label = self.program_number, None

    def _relocate(self) -> None:
        """Let the program go on from where the motors are, and the axes as they count now."""
        if self._run is not None and self._planner is not None:
            self._run.relocate(self.frame.positions())
            self._planner.relocate(self.frame.places, self.frame.shifted)

    def _begin(self, motors: tuple[Motor, ...]) -> None:
        self.time_base.restart()
        for motor in motors:
            motor.program_timer = True
            motor.stopped_at = None
            motor.travel.stopped = False
        self._player = Player(self.frame.places, self._refill, self._assign)
        self.running, self.busy = True, True
        self.runtime_error = self.radius_error = False

    def _refill(self) -> Iterable[Piece]:
        run, planner = self._run, self._planner
        if run is None or planner is None or not self.running or self._event is not None:
            return ()
        self._executing_at = run.program, run.line
        run.single_step = self.single_step
        try:
            planned = planner.plan()
            pieces = planned.pieces
            if planned.finished:
                self.running, self._run = False, None
            elif self.single_step and not run.in_block:
                pieces += planner.settle()
                self.running = False
        except PmacError as failed:
            self.running, self.runtime_error = False, True
            self.radius_error = isinstance(failed, CircleRadiusError)
            self._run = None
            return self._halt()
        self._event, self._newest = planned.event, pieces
        return pieces

    def _carry_out(self, event: Event) -> None:
        """Do what waits for the motion before it, once that has been played and the motors stand."""
        player = self._player
        if player is None or not player.idle:
            return
        self._event = None
        match event:
            case HomeRequest():
                self._seek_homes(event)
                return
            case PresetRequest():
                axes = self.frame.positions()
                self._preset({axis: place for axis, place in event.positions.items() if axis in axes})
            case Halt():
                self.running = False
        if not self.running:
            self._rest(player.position)

    def _seek_homes(self, request: HomeRequest) -> None:
        """HOME in a program: the motors are their own until all of them are done."""
        self._player = None
        motors = tuple(self._motors[number] for number in request.motors if number in self._motors)
        taken = [motor for motor in motors if motor.program_timer and motor not in self.motors]
        if len(motors) < len(request.motors) or taken or not all(motor.activated for motor in motors):
            self._fail()
            return
        for motor in motors:
            if request.zero:
                motor.home_zero()
            else:
                motor.home()
        self._homing = motors

    def _wait_for_homes(self) -> None:
        if not self._homing or any(motor.jogging for motor in self._homing):
            return
        homed, self._homing = all(motor.home_complete for motor in self._homing), ()
        if not homed or self._run is None:
            self._fail()
            return
        self._relocate()
        if self.running:
            self._player = Player(self.frame.places, self._refill, self._assign)
        else:
            self._rest(self.frame.places)

    def _fail(self) -> None:
        """A run-time error at rest."""
        self.running, self.runtime_error = False, True
        self._run = None
        self._rest(None)

    def _rest(self, position: Vector | None) -> None:
        """No motion is left; `position` is where a program that was stopped has to go on, None wherever it is."""
        self._player = None
        if not self.running and self._run is None:
            self._planner = None
        self._resume_from = position
        self.time_base.restart()
        self.busy = not self.time_base.steady
        for place, motor in enumerate(self.motors):
            motor.program_timer = False
            motor.stopped_at = position[place] if position is not None and self._run is not None else None

    def _take_back(self) -> bool:
        """Stop in front of the move that was calculated last; False when it is too late for that."""
        if self._planner is None or self._player is None:
            return False
        planner = copy(self._planner)
        try:
            if not planner.take_back() or not self._player.replace(self._newest, planner.settle()):
                return False
        except PmacError:
            return False
        self._planner, self._event = planner, None
        return True

    def _halt(self) -> tuple[Piece, ...]:
        if self._planner is None:
            return ()
        return self._planner.halt(tuple(motor.variable(15) for motor in self.motors))

    def _forget_run(self) -> None:
        self._run = self._planner = self._resume_from = self._run_number = None
        for motor in self.motors:
            motor.stopped_at = None

    def _assign(self, deferred: tuple[Deferred, ...]) -> None:
        try:
            for each in deferred:
                self._variables.set(each.kind, each.index, each.value, self.number)
        except PmacError:
            self.running, self.runtime_error = False, True
            self._run = None
            if self._player is not None:
                self._player.append(self._halt())

    def _preset(self, presets: Mapping[str, float]) -> None:
        self.frame.preset(presets)
        self._relocate()

    def _frozen(self, player: Player) -> bool:
        return self.time_base.stopped and not player.in_real_time

    def _refuse_moving(self) -> None:
        if self.running or self.moving:
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{self.number} is moving")
