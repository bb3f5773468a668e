"""The simulated PMAC: variables, motors, a coordinate system, program buffers and its background cycle.

It has no clock of its own: it is advanced by servo cycles. What the background does (limits, replies to the
host) happens between two blocks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from drivers.pmac.axes import AxisDefinition
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.structure import link
from drivers.pmac.language.syntax import Line
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.variables import VariableStore
from drivers.simulator.coordinate import CoordinateSystem
from drivers.simulator.motor import HomeSensor, Motor
from drivers.simulator.servo import Axis

SYSTEM_COUNT = 8
"""Coordinate systems of the non-Turbo controller."""


@dataclass(slots=True)
class ProgramBuffer:
    """The stored lines of one motion program."""

    lines: list[Line] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenBuffer:
    """The program that is being filled, and the host that opened it: nobody else may fill it."""

    program: int
    owner: object


class Controller:
    """State and behaviour of the card; ports and plants are attached from outside."""

    def __init__(
        self,
        i_variables: Mapping[int, float],
        axes: Mapping[int, tuple[Axis, HomeSensor]],
        definitions: tuple[AxisDefinition, ...],
        servo_period_ms: float,
    ) -> None:
        """`servo_period_ms` is the true rate of the hardware; I10 only tells the card about it."""
        self.servo_period_ms = servo_period_ms
        self.variables = VariableStore(i_variables)
        self.motors = {number: Motor(number, self.variables, axis, home) for number, (axis, home) in axes.items()}
        self.systems = {
            number: CoordinateSystem(number, self.variables, self.motors) for number in range(1, SYSTEM_COUNT + 1)
        }
        for definition in definitions:
            self.systems[1].define(definition.motor, definition)
        self.programs: dict[int, ProgramBuffer] = {}
        self.open_buffer: OpenBuffer | None = None
        self.cycles = 0
        self._profile_i_variables = dict(i_variables)
        self._profile_definitions = definitions

    @property
    def cycle_ms(self) -> float:
        """Servo time as I10 states it, ms: what trajectories are calculated with."""
        return servo_cycle_ms(self.variables.i(10))

    @property
    def now_ms(self) -> float:
        """Time since the start, as a count of servo cycles."""
        return self.cycles * self.servo_period_ms

    @property
    def any_program_running(self) -> bool:
        """Whether a coordinate system runs a program."""
        return any(system.running for system in self.systems.values())

    def run_block(self, cycles: int) -> dict[int, list[float]]:
        """Run `cycles` servo cycles; return the true machine positions (counts) of each motor."""
        cycle_ms = self.cycle_ms
        commands: dict[int, list[float]] = {}
        for system in self.systems.values():
            if system.moving:
                commands.update(system.sample(cycles, cycle_ms))
        self.cycles += cycles
        return {number: motor.run(cycles, cycle_ms, commands.get(number)) for number, motor in self.motors.items()}

    def background(self) -> None:
        """Check following errors, as the card does between two servo interrupts and in no fixed time."""
        for motor in self.motors.values():
            if motor.out_of_hand:
                self._trip(motor)

    def system_of(self, motor: int) -> CoordinateSystem | None:
        """Return the coordinate system that a motor is assigned to."""
        return next((s for s in self.systems.values() if motor in s.definitions), None)

    def define_axis(self, system: int, motor: int, definition: AxisDefinition | None) -> None:
        """Assign a motor to an axis of a coordinate system.

        Raises:
            PmacError: 001 while a program moves axes, 003 when the motor belongs to another system, 013 when
                this machine has no such motor.
        """
        if any(other.running or other.moving for other in self.systems.values()):
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "axis definition")
        if motor not in self.motors:
            raise PmacError(ErrorCode.NOT_ACTIVATED, f"motor {motor}")
        owner = self.system_of(motor)
        if owner is not None and owner.number != system:
            raise PmacError(ErrorCode.DATA_ERROR, f"motor {motor} is in &{owner.number}")
        self.systems[system].define(motor, definition)

    def start_program(self, system: int) -> None:
        """Run the program that a coordinate system points to.

        Raises:
            PmacError: 015 no such program, 009 or 016 a program that is not well formed, and those of `start`.
        """
        coordinate = self.systems[system]
        buffer = self.programs.get(coordinate.program_number or 0)
        if buffer is None:
            raise PmacError(ErrorCode.NO_PROGRAM, f"&{system} points to no program")
        coordinate.start(link(tuple(buffer.lines)))

    def abort_all(self) -> None:
        """Control-A: every program is dropped, every activated motor ramps down; open loops are closed."""
        for system in self.systems.values():
            system.kill()
        for motor in self.motors.values():
            if motor.activated:
                motor.abort()

    def kill_all(self) -> None:
        """Control-K: every loop is opened."""
        for system in self.systems.values():
            system.kill()
        for motor in self.motors.values():
            motor.kill()

    def reset(self, factory: Mapping[int, float] | None = None) -> None:
        """Start again from the machine's settings, or from factory defaults without axes."""
        self.kill_all()
        for motor in self.motors.values():
            motor.reset()
        self.open_buffer = None
        self.variables.replace_i(self._profile_i_variables if factory is None else factory)
        for system in self.systems.values():
            system.reset()
        if factory is not None:
            self.programs.clear()
            return
        for definition in self._profile_definitions:
            self.systems[1].define(definition.motor, definition)

    def _trip(self, motor: Motor) -> None:
        """A fatal following error kills the motor and, as Ix25 says, its neighbours; the others ramp down."""
        system = self.system_of(motor.number)
        if system is not None:
            system.abort(closing=False)
        mode = int(motor.variable(25)) >> 21 & 3
        others = self.motors.values() if mode == 0 else system.motors if system and mode == 1 else [motor]
        for other in others:
            other.kill()
        motor.fatal_error = True
