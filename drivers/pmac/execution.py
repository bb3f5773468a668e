"""The execution of a motion program: from statements to requests for motion, one at a time.

Serves the simulator, which plays the requests, and the checker, which only draws them. It knows axes in
user units, not motors. Calculation happens when a request is asked for, one move ahead of the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.evaluate import Value, compile_condition, compile_expression
from drivers.pmac.language.structure import Code
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.trajectory.linear import MOVE_TIME_MAX_MS
from drivers.pmac.variables import VariableStore

FEEDRATE_AXES = ("X", "Y", "Z")
"""The axes whose distance a feedrate speaks of, until a program says otherwise."""

JUMPS_THAT_BREAK_BLENDING = 2
"""Backward jumps met while looking for the next move after which the motion is let stop."""


@dataclass(slots=True)
class Modes:
    """What stays in force from line to line and from program to program of a coordinate system."""

    mode: str = "LINEAR"
    incremental: set[str] = field(default_factory=set)
    by_move_time: bool = False
    pvt_ms: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearRequest:
    """A LINEAR move to `targets` (user units, every axis of the system), with the times in force in ms."""

    line: int
    targets: Mapping[str, float]
    ta_ms: float
    ts_ms: float
    tm_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PvtRequest:
    """A PVT segment to `targets` with `velocities` there (user units, user units per ms)."""

    line: int
    targets: Mapping[str, float]
    velocities: Mapping[str, float]
    duration_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DwellRequest:
    """Come to rest, then wait in real time."""

    duration_ms: float


@dataclass(frozen=True, slots=True)
class BlendBreak:
    """Two backward jumps without a move: let the previous move stop, then ask again."""


@dataclass(frozen=True, slots=True)
class Finished:
    """The end of the program."""


Request = LinearRequest | PvtRequest | DwellRequest | BlendBreak | Finished


class ProgramRun:
    """One program on its way, from its first statement to `Finished`."""

    def __init__(
        self,
        code: Code,
        variables: VariableStore,
        modes: Modes,
        positions: Mapping[str, float],
        system: int = 1,
        strict: bool = True,
    ) -> None:
        """`positions` are the commanded positions of the defined axes at the start, in user units.

        `strict` makes illegal arithmetic an error, as a checker wants it; the card calculates on.
        """
        self.line = 0
        self._code = code
        self._variables = variables
        self._modes = modes
        self._positions = dict(positions)
        self._system = system
        self._degrees = variables.i(15) == 0
        self._strict = strict
        self._counter = 0
        self._jumps_back = 0
        self._steps = [self._compile(index) for index in range(len(code.instructions))]

    def advance(self) -> Request:
        """Calculate up to the next request for motion.

        Raises:
            PmacError: a run-time error of the program; the caller stops it.
        """
        self._jumps_back = 0
        while self._counter < len(self._steps):
            index = self._counter
            self.line = self._code.line_of[index]
            self._counter = index + 1
            request = self._steps[index]()
            if request is not None:
                return request
            if self._jumps_back >= JUMPS_THAT_BREAK_BLENDING:
                return BlendBreak()
        return Finished()

    def _compile(self, index: int) -> Callable[[], Request | None]:
        statement = self._code.instructions[index]
        jump = self._code.jumps[index]
        match statement:
            case syntax.Assign():
                return self._assign(statement)
            case syntax.Set():
                return self._set(statement)
            case syntax.Move():
                return self._move(statement)
            case syntax.Wait():
                return self._wait(statement)
            case syntax.SelectMode() | syntax.Positioning():
                return lambda: self._select(statement)
            case syntax.While() | syntax.If():
                return self._branch(statement.condition, jump)
            case syntax.EndWhile():
                return lambda: self._jump_back(jump)
            case syntax.Else():
                return lambda: self._jump(jump)
            case syntax.EndIf():
                return _nothing

    def _expression(self, expression: syntax.Expression) -> Value:
        return compile_expression(expression, self._degrees, strict=self._strict)

    def _assign(self, statement: syntax.Assign) -> Callable[[], None]:
        value = self._expression(statement.value)
        kind, variables = statement.target.kind, self._variables
        if isinstance(statement.target.index, syntax.Number):
            fixed = int(statement.target.index.value)
            return lambda: variables.set(kind, fixed, value(variables))
        index = self._expression(statement.target.index)

        def step() -> None:
            variables.set(kind, int(index(variables)), value(variables))

        return step

    def _set(self, statement: syntax.Set) -> Callable[[], None]:
        value = self._expression(statement.value)
        word = statement.word

        def step() -> None:
            self._set_modal(word, value(self._variables))

        return step

    def _set_modal(self, word: str, value: float) -> None:
        if word in ("TA", "TS"):
            number = 87 if word == "TA" else 88
            self._keep(number, float(_whole_ms(word, value)))
            if word == "TA":
                self._modes.pvt_ms = self._modes.pvt_ms and _whole_ms(word, value)
        elif word == "PVT":
            self._modes.mode = "PVT"
            self._modes.pvt_ms = _whole_ms(word, value)
            if self._modes.pvt_ms == 0:
                raise PmacError(ErrorCode.DATA_ERROR, "a PVT segment of no time")
        else:
            self._modes.by_move_time = word == "TM"
            self._keep(89, value)

    def _keep(self, number: int, value: float) -> None:
        self._variables.set(VariableKind.I, self._variables.dialect.system_index(self._system, number), value)

    def _modal(self, number: int) -> float:
        return self._variables.system(self._system, number)

    def _select(self, statement: syntax.SelectMode | syntax.Positioning) -> None:
        if isinstance(statement, syntax.SelectMode):
            self._modes.mode = statement.mode
            return
        axes = set(statement.axes or self._positions)
        if statement.incremental:
            self._modes.incremental |= axes
        else:
            self._modes.incremental -= axes

    def _move(self, statement: syntax.Move) -> Callable[[], Request]:
        words = [
            (
                word.axis,
                self._expression(word.value),
                self._expression(word.velocity) if word.velocity is not None else None,
            )
            for word in statement.words
        ]

        def step() -> Request:
            targets, velocities = dict(self._positions), {}
            for axis, value, velocity in words:
                if axis not in targets:
                    continue  # an axis that no motor is assigned to: the word has no effect
                here = targets[axis] if axis in self._modes.incremental else 0.0
                targets[axis] = here + value(self._variables)
                if velocity is not None:
                    velocities[axis] = velocity(self._variables)
            return self._request(targets, velocities)

        return step

    def _request(self, targets: dict[str, float], velocities: dict[str, float]) -> Request:
        start, self._positions = self._positions, targets
        if self._modes.mode == "PVT":
            if self._modes.pvt_ms == 0:
                raise PmacError(ErrorCode.DATA_ERROR, "a PVT segment of no time")
            unit_ms = self._modal(90) or 1000.0
            return PvtRequest(
                line=self.line,
                targets=targets,
                velocities={axis: velocity / unit_ms for axis, velocity in velocities.items()},
                duration_ms=self._modes.pvt_ms,
            )
        if velocities:
            raise PmacError(ErrorCode.DATA_ERROR, "an end velocity belongs to PVT moves")
        return self._linear(targets, self._move_time_ms(start, targets))

    def _linear(self, targets: dict[str, float], tm_ms: float) -> LinearRequest:
        return LinearRequest(
            line=self.line,
            targets=targets,
            ta_ms=self._variables.blend_ms(self._system, 87),
            ts_ms=self._variables.blend_ms(self._system, 88),
            tm_ms=tm_ms,
        )

    def _move_time_ms(self, start: Mapping[str, float], targets: Mapping[str, float]) -> float:
        """TM as it stands, or the distance of the feedrate axes over F (the last of the two words wins)."""
        value = self._modal(89)
        if self._modes.by_move_time:
            return value
        distance = math.hypot(*(targets[a] - start[a] for a in FEEDRATE_AXES if a in targets))
        if distance == 0.0:
            return 0.0
        if value <= 0.0:
            raise PmacError(ErrorCode.DATA_ERROR, f"feedrate F{value:g}; above 0")
        return min(distance / value * (self._modal(90) or 1000.0), MOVE_TIME_MAX_MS)

    def _wait(self, statement: syntax.Wait) -> Callable[[], Request]:
        duration = self._expression(statement.duration_ms)

        def step() -> Request:
            duration_ms = max(0.0, duration(self._variables))
            if statement.word == "DELAY":
                return self._linear(dict(self._positions), duration_ms)
            return DwellRequest(duration_ms=duration_ms)

        return step

    def _branch(self, condition: syntax.Condition, otherwise: int) -> Callable[[], None]:
        holds = compile_condition(condition, self._degrees, strict=self._strict)

        def step() -> None:
            if not holds(self._variables):
                self._counter = otherwise

        return step

    def _jump(self, target: int) -> None:
        self._counter = target

    def _jump_back(self, target: int) -> None:
        self._counter = target
        self._jumps_back += 1


def _nothing() -> None:
    """Do nothing: the end of an IF."""


def _whole_ms(word: str, value: float) -> int:
    """Round to the nearest whole millisecond, as the controller does when the word is executed."""
    rounded = math.floor(value + 0.5)
    if not 0 <= rounded <= MOVE_TIME_MAX_MS:
        raise PmacError(ErrorCode.DATA_ERROR, f"{word} {value} ms, 0 to {MOVE_TIME_MAX_MS:.0f}")
    return rounded
