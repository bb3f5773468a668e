"""A coordinate system of the simulated controller: axis definitions and the program that it runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from drivers.pmac.axes import AxisDefinition, axis_positions
from drivers.pmac.execution import Modes, ProgramRun
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.structure import Code
from drivers.pmac.trajectory.pieces import Piece
from drivers.pmac.trajectory.planner import MotionPlanner
from drivers.pmac.variables import VariableStore
from drivers.simulator.motor import Motor
from drivers.simulator.player import Player


class CoordinateSystem:
    """Which motors move together, and the program that moves them."""

    def __init__(self, number: int, variables: VariableStore, motors: Mapping[int, Motor]) -> None:
        self.number = number
        self.definitions: dict[int, AxisDefinition] = {}
        self.program_number: int | None = None
        self.modes = Modes()
        self.running = False
        self.runtime_error = False
        self._variables = variables
        self._motors = motors
        self._planner: MotionPlanner | None = None
        self._player: Player | None = None

    @property
    def moving(self) -> bool:
        """Whether calculated motion is still being played."""
        return self._player is not None

    @property
    def motors(self) -> list[Motor]:
        """The motors of this system, in the order of their numbers."""
        return [self._motors[number] for number in sorted(self.definitions)]

    def define(self, motor: int, definition: AxisDefinition | None) -> None:
        """Assign a motor to an axis, or clear it."""
        self.definitions.pop(motor, None)
        if definition is not None:
            self.definitions[motor] = definition

    def start(self, code: Code) -> None:
        """Run a program from its first line.

        Raises:
            PmacError: 001 something runs, 012 a motor is open loop, 013 not activated, 014 no motors.
        """
        motors = self.motors
        if not motors:
            raise PmacError(ErrorCode.NO_MOTORS, f"&{self.number}")
        if self.running or self.moving or any(motor.jogging for motor in motors):
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{self.number} is moving")
        if not all(motor.activated for motor in motors):
            raise PmacError(ErrorCode.NOT_ACTIVATED, f"&{self.number}")
        if not all(motor.enabled for motor in motors):
            raise PmacError(ErrorCode.OPEN_LOOP, f"&{self.number}")
        desired = {motor.number: motor.desired for motor in motors}
        positions = axis_positions(self.definitions, desired)
        run = ProgramRun(code, self._variables, self.modes, positions, self.number, strict=False)
        ordered = tuple(self.definitions[motor.number] for motor in motors)
        start = tuple(desired[motor.number] for motor in motors)
        self._planner = MotionPlanner(run, ordered, self._variables, start, self.number)
        self._player = Player(start, self._refill)
        self.running, self.runtime_error = True, False

    def quit(self) -> None:
        """Calculate no further move; what is calculated is played, then the motors stop."""
        if self.running and self._player is not None:
            self._player.append(self._halt())
            self.running = False

    def abort(self, closing: bool = True) -> None:
        """Forget the program; each motor ramps down by itself, and `closing` closes the loops that are open."""
        self._drop()
        for motor in self.motors:
            if closing or motor.enabled:
                motor.abort()

    def kill(self) -> None:
        """Forget the program; the motors are somebody else's to stop."""
        self._drop()

    def reset(self) -> None:
        """Forget everything, as at power-up."""
        self._drop()
        self.definitions.clear()
        self.program_number = None
        self.modes = Modes()
        self.runtime_error = False

    def sample(self, cycles: int, cycle_ms: float) -> dict[int, list[float]]:
        """Return the commands of a block by motor number, nothing when no motion is being played."""
        if self._player is None:
            return {}
        tracks = self._player.sample(cycles, cycle_ms)
        commands = {motor.number: track for motor, track in zip(self.motors, tracks, strict=True)}
        if not self.running and self._player.idle:
            self._player = None
            self._planner = None
        return commands

    def _refill(self) -> Iterable[Piece]:
        if not self.running or self._planner is None:
            return ()
        try:
            planned = self._planner.plan()
        except PmacError:
            self.running, self.runtime_error = False, True
            return self._halt()
        self.running = not planned.finished
        return planned.pieces

    def _halt(self) -> tuple[Piece, ...]:
        assert self._planner is not None
        return self._planner.halt(tuple(motor.variable(15) for motor in self.motors))

    def _drop(self) -> None:
        self._planner = self._player = None
        self.running = False
