"""A coordinate system of the simulated controller: its commands, its reports, and when it may move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

from drivers.pmac.axes import AxisDefinition
from drivers.pmac.dialect import FamilySetting
from drivers.pmac.execution.kinematics import kinematics_of
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.run import Library, ProgramRun
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.listing import StoredLine
from drivers.pmac.requests import ProgramHost
from drivers.pmac.trajectory.pieces import Vector
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.axis_frame import AxisFrame
from drivers.simulator.card.motor import Motor
from drivers.simulator.card.program_motion import Place, ProgramMotion, TimeBase

OFF_BY_COUNTS = 1.0 / 32.0  # permitted distance from where a program was stopped; no finer is resolved


class CoordinateSystem:
    """The motors that move together, their program, and the run control of a host.

    A program stopped on the way (Q, S, STOP, A and the like) can be resumed, until another one is pointed at.
    `busy` is whether a block of servo cycles affects the system at all.
    """

    def __init__(
        self,
        number: int,
        variables: VariableStore,
        motors: Mapping[int, Motor],
        library: Library,
        host: ProgramHost,
        busy: set[int] | None = None,
    ) -> None:
        """Take `busy`, the numbers of all systems that are busy."""
        self.number = number
        self._all_busy: set[int] = set() if busy is None else busy
        self.frame = AxisFrame(motors)
        self.time_base = TimeBase(number, variables)
        self.motion = ProgramMotion(number, variables, motors, self.frame, self.time_base)
        self.program_number: int | None = None
        self.modes = Modes()
        self.kinematic_lines: dict[str, list[StoredLine]] = {}
        self.end_of_block_stop = False
        self.program_hold = False
        self.resume_error = False
        self._variables = variables
        self._library = library
        self._host = host
        self._label: int | None = None

    @property
    def busy(self) -> bool:
        """Whether it has to be sampled in the next block."""
        return self.number in self._all_busy

    @busy.setter
    def busy(self, busy: bool) -> None:
        (self._all_busy.add if busy else self._all_busy.discard)(self.number)

    @property
    def running(self) -> bool:
        """Whether moves of a program are still to be calculated."""
        return self.motion.running

    @property
    def moving(self) -> bool:
        """Whether calculated motion is still being played."""
        return self.motion.moving

    @property
    def in_control(self) -> bool:
        """Whether the motors belong to the program: nothing else may move them, unless a feed hold holds them."""
        return (self.running or self.moving) and self.motion.held_at is None

    def set_override(self, percent: float) -> None:
        """`%`: command another time base. Raises PmacError: 003, below 0."""
        self.time_base.set_override(percent)
        self.busy = True

    def define(self, motor: int, definition: AxisDefinition | None) -> None:
        """Assign a motor to its axes, or clear it."""
        self.motion.forget()
        self.frame.define(motor, definition)

    def point(self, program: int, label: int | None = None) -> None:
        """B: the next R begins there. Raises PmacError: 001, a program runs."""
        if self.running:
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{self.number} runs a program")
        self.motion.forget()
        self.program_number, self._label = program, label

    def run(self) -> None:
        """R: run the program, resume it where it was stopped, or resume after a feed hold.

        Raises:
            PmacError: 001 something runs, 010 both limits, 011 the stop is not yet done, 012 a motor is open
                loop, 013 not activated, 014 no motors, 015 no program, 009 or 016 a program that is not well
                formed, 017 a motor was moved since the stop.
        """
        self._go(stepping=False)

    def step(self) -> None:
        """S: the same for one move, or for the lines from BLOCKSTART to BLOCKSTOP. Raises PmacError: as `run`."""
        self._go(stepping=True)

    def quit(self) -> None:
        """Q: calculate no further move; the calculated motion is played, then the motors stop."""
        self.motion.quit()

    def stop_at_block(self) -> None:
        """`/`: stop at the end of the move that is played, where moves are segmented; otherwise as Q does."""
        self.end_of_block_stop = self.running
        segmented = self._variables.setting(FamilySetting.SEGMENT_MS, self.number) > 0.0
        if not (segmented and self.motion.take_back()):
            self.motion.quit()

    def hold(self) -> None:
        """H: let the time base go to 0 at Ix95."""
        self.time_base.hold()
        self.busy = True

    def quick_hold(self) -> None:
        """Hold the program (backslash): the same, as there is no segment buffer to stop in."""
        self.program_hold = self.running or self.moving
        self.hold()

    def abort(self, closing: bool = True) -> None:
        """Abort the motion; each motor ramps down by itself, and `closing` closes the loops that are open."""
        self.kill()
        for motor in self.frame.motors:
            if closing or motor.enabled:
                motor.abort()

    def kill(self) -> None:
        """Drop the motion; the caller stops the motors."""
        self.motion.drop()

    def reset(self) -> None:
        """Clear everything, as at power-up."""
        self.motion.reset()
        self.frame.clear()
        self.program_number = self._label = None
        self.modes = Modes()
        self.time_base.reset()
        self.resume_error = self.end_of_block_stop = self.program_hold = False

    def match_positions(self) -> None:
        """PMATCH: take the axis positions from the motors, also to resume. Raises PmacError: 001, it moves."""
        self._refuse_moving()
        self.frame.stopped_at = None
        self._take_kinematics()
        self.frame.positions()

    def set_axis(self, axis: str, position: float) -> None:
        """`X=5`: preset an axis (user units) at rest. Raises PmacError: 001 a program moves, 003 no such axis."""
        self._refuse_moving()
        self.motion.preset({axis: position})

    def zero_axes(self) -> None:
        """Z: preset the present position of every axis to zero. Raises PmacError: 001, a program moves them."""
        self._refuse_moving()
        self.motion.preset(dict.fromkeys(self.frame.positions(), 0.0))

    def program_counter(self) -> Place:
        """PC: the program and the line that are calculated next."""
        return self.motion.calculated_at or (self.program_number or 0, 0)

    def executing(self) -> Place:
        """PE: the program and the line that are being executed."""
        return self.motion.executing_at if self.moving else self.program_counter()

    def sample(self, cycles: int, cycle_ms: float) -> dict[int, list[float]]:
        """Return the commands of a block by motor number, nothing when no program motion is being played."""
        commands = self.motion.sample(cycles, cycle_ms)
        if not commands:
            self.busy = self.moving or not self.time_base.steady
        return commands

    def _go(self, stepping: bool) -> None:
        motion, motors = self.motion, self.frame.motors
        # A running program is the first thing the host must know, whatever is wrong with the motors.
        if self.time_base.holding or not self.in_control:
            _refuse_unfit(motors)
        self.resume_error = False
        if self.time_base.holding and motion.moving:
            self._refuse_moved(motion.held_at)
            motion.release(stepping)
        else:
            if motion.moving and not motion.running and motion.resumable:
                raise PmacError(ErrorCode.MOVE_NOT_COMPLETED, f"&{self.number} is not yet at rest")
            self._refuse_moving()
            for motor in motors:
                if motor.jogging:
                    raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"#{motor.number} is moving")
            self._prepare()
            motion.begin(stepping)
            self.end_of_block_stop = False
        self.program_hold, self.busy = False, True

    def _prepare(self) -> None:
        motion = self.motion
        if self.program_number is None:
            raise PmacError(ErrorCode.NO_PROGRAM, f"&{self.number} points to no program")
        self._take_kinematics()
        if not motion.resumable:
            motion.load(self._program(self.program_number))
            self._label = None
            return
        stopped = self.frame.stopped_at
        self._refuse_moved(stopped)
        if stopped is None:
            motion.relocate()

    def _take_kinematics(self) -> None:
        """Solve the axes by the kinematic programs as they are now. Raises PmacError: 009, 016, malformed."""
        lines = {kind: [line.statements for line in kept] for kind, kept in self.kinematic_lines.items()}
        self.frame.kinematics = kinematics_of(lines, self._variables, self.number)

    def _program(self, number: int) -> ProgramRun:
        if (code := self._library(number)) is None:
            raise PmacError(ErrorCode.NO_PROGRAM, f"program {number}")
        return ProgramRun(
            code,
            self._variables,
            self.modes,
            self.frame.positions(),
            self.number,
            strict=False,
            library=cache(self._library),
            host=self._host,
            label=self._label,
            number=number,
        )

    def _refuse_moving(self) -> None:
        if self.running or self.moving:
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{self.number} is moving")

    def _refuse_moved(self, stopped: Vector | None) -> None:
        """Check that every motor is still where a program was stopped, in counts; None is anywhere."""
        if stopped is None:
            return
        for motor, position in zip(self.frame.motors, stopped, strict=True):
            if motor.jogging or abs(motor.desired - position) > OFF_BY_COUNTS:
                self.resume_error = True
                detail = f"#{motor.number} was stopped at {position:g} counts"
                raise PmacError(ErrorCode.OFF_STOPPED_POSITION, detail)


def _refuse_unfit(motors: Sequence[Motor]) -> None:
    """Check that there are motors, all activated, in closed loop, and free to move at least one way."""
    if not motors:
        raise PmacError(ErrorCode.NO_MOTORS, "no motor has an axis")
    for motor in motors:
        if not motor.activated:
            raise PmacError(ErrorCode.NOT_ACTIVATED, f"#{motor.number}")
    for motor in motors:
        if not motor.enabled:
            raise PmacError(ErrorCode.OPEN_LOOP, f"#{motor.number}")
    for motor in motors:
        if motor.travel.positive and motor.travel.negative:
            raise PmacError(ErrorCode.BOTH_LIMITS_SET, f"#{motor.number}")
