"""Kinematics of a coordinate system: what its two programs make of axis positions and of motor positions.

The forward program gets the motor positions in P1 to P32 (counts) and leaves those of A, B, C, U, V, W, X, Y and Z
in Q1 to Q9. The inverse program gets those, and leaves the motor positions. Q10 is 0; in a PVT segment it is 1:
then Q11 to Q19 are the velocities of the axes, and P101 to P132 those of the motors.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from drivers.pmac.axes import AXIS_LETTERS, AxisDefinition
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.listing import StoredLine, stored_line
from drivers.pmac.language.structure import ExecutableProgram, link
from drivers.pmac.language.syntax import Line, VariableKind
from drivers.pmac.requests import EndOfProgram
from drivers.pmac.variables import VariableStore

VELOCITY_FLAG, VELOCITIES, MOTOR_VELOCITIES = 10, 10, 100  # Q10; Q11 is that of A, P101 that of motor 1
MOST_LOOKS = 2000  # passes of loops in a program after which it has no end
FEED_TIME = 90  # Isx90: velocities are in user units and counts in so many ms

_CALCULATES = (syntax.Assign, syntax.While, syntax.If, syntax.Else, syntax.EndIf, syntax.EndWhile)


class Kinematics:
    """The programs of one coordinate system, ready to run."""

    def __init__(
        self, inverse: ExecutableProgram, forward: ExecutableProgram, variables: VariableStore, system: int
    ) -> None:
        self._values = variables.view(system)
        self._feed_ms = variables.system(system, FEED_TIME)
        runs = (ProgramRun(code, variables, Modes(), {}, system, strict=False) for code in (inverse, forward))
        self._inverse, self._forward = runs

    def positions(self, counts: Mapping[int, float]) -> dict[str, float]:
        """Return the axis positions for motor positions. Raises PmacError: a run-time error of the program."""
        for motor, place in counts.items():
            self._values.set(VariableKind.P, motor, place)
        _execute(self._forward)
        return {axis: self._values.get(VariableKind.Q, n) for n, axis in enumerate(AXIS_LETTERS, 1)}

    def counts(self, targets: Mapping[str, float], motors: Iterable[int]) -> dict[int, float]:
        """Return the positions of some motors for axis positions. Raises PmacError: as `positions`."""
        self._aim(targets)
        self._values.set(VariableKind.Q, VELOCITY_FLAG, 0.0)
        _execute(self._inverse)
        return {motor: self._values.get(VariableKind.P, motor) for motor in motors}

    def moving(
        self, targets: Mapping[str, float], velocities: Mapping[str, float], motors: Iterable[int]
    ) -> dict[int, tuple[float, float]]:
        """Return positions and velocities (counts/ms) of motors for those of the axes (user units, a ms)."""
        self._aim(targets)
        self._values.set(VariableKind.Q, VELOCITY_FLAG, 1.0)
        for n, axis in enumerate(AXIS_LETTERS, 1):
            self._values.set(VariableKind.Q, VELOCITIES + n, velocities.get(axis, 0.0) * self._feed_ms)
        _execute(self._inverse)
        p = VariableKind.P
        return {
            motor: (self._values.get(p, motor), self._values.get(p, MOTOR_VELOCITIES + motor) / self._feed_ms)
            for motor in motors
        }

    def _aim(self, targets: Mapping[str, float]) -> None:
        for n, axis in enumerate(AXIS_LETTERS, 1):
            if axis in targets:
                self._values.set(VariableKind.Q, n, targets[axis])


def stored_kinematic_line(text: str) -> StoredLine:
    """Return a typed line as it is kept. Raises PmacError: 003, it does more than calculate."""
    line = stored_line(text)
    refuse_more_than_calculation(line.statements)
    return line


def refuse_more_than_calculation(line: Line) -> None:
    """Refuse everything but assignments, conditions and loops. Raises PmacError: 003."""
    for statement in line:
        if not isinstance(statement, _CALCULATES) or (
            isinstance(statement, syntax.Assign) and statement.synchronous
        ):
            raise PmacError(ErrorCode.DATA_ERROR, "a kinematic program has assignments, conditions and loops only")


def kinematics_of(lines: Mapping[str, Iterable[Line]], variables: VariableStore, system: int) -> Kinematics | None:
    """Return the kinematics of a system by the lines of its programs; None while Isx50 switches them off.

    Raises PmacError: 009 or 016, one is not well formed.
    """
    number = variables.dialect.kinematics
    if number is None or not variables.system(system, number):
        return None
    inverse, forward = (link(tuple(lines.get(kind, ()))) for kind in (INVERSE, FORWARD))
    return Kinematics(inverse, forward, variables, system)


INVERSE, FORWARD = "INVERSE", "FORWARD"
KINDS = {INVERSE: INVERSE, "INV": INVERSE, FORWARD: FORWARD, "FWD": FORWARD}
"""How the buffers are called, and by which name they are listed."""


def with_kinematics(definition: AxisDefinition, kinematics: Kinematics | None) -> AxisDefinition:
    """Return a definition that is solved by the kinematics, if it is of that kind."""
    return definition.solved_by(kinematics) if definition.inverse else definition


def _execute(run: ProgramRun) -> None:
    run.rewind()
    for _ in range(MOST_LOOKS):
        if isinstance(run.advance(), EndOfProgram):
            return
    raise PmacError(ErrorCode.DATA_ERROR, "a kinematic program without an end")
