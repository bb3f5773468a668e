"""Statements that are executed in place: motion words become requests, each compiled once and run many times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict

from drivers.pmac import requests
from drivers.pmac.execution.move_times import Modes, MoveTimes
from drivers.pmac.language import evaluate, syntax
from drivers.pmac.language.blocks import WORTH
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.evaluate import Value
from drivers.pmac.language.python_text import PythonText
from drivers.pmac.language.syntax import VECTOR, Feedrate, Positioning, SelectMode, VariableKind
from drivers.pmac.requests import ProgramHost, Request
from drivers.pmac.variables import SystemVariables

Plain = (
    syntax.Modal
    | syntax.Assign
    | syntax.Move
    | syntax.Preset
    | syntax.HomeMotors
    | syntax.Wait
    | syntax.Argument
    | syntax.Message
    | syntax.PlcSwitch
)
"""The statements that do not change the order of execution."""

Step = Callable[[], Request | None]

_SPINDLE_SPEED = 127  # S alone sets this Q-variable

Word = tuple[str, Value, Value | None]
"""An axis word: its letter, the expression of position or distance, and the end velocity."""

_RADIUS = "R"
_CIRCLES = ("CIRCLE1", "CIRCLE2")
_SPLINES = ("SPLINE1", "SPLINE2")


class _Aim:
    """The start and target of a line's axes, and which of them have an absolute target (ABS)."""

    def __init__(
        self, line: int, start: Mapping[str, float], targets: dict[str, float], absolute: frozenset[str]
    ) -> None:
        self.line = line
        self.start = start
        self.targets = targets
        self.absolute = absolute


class _Common(TypedDict):
    """What every request for a move has."""

    line: int
    targets: Mapping[str, float]
    absolute: frozenset[str]
    deferred: tuple[requests.DeferredValue, ...]


class Moves:
    """The axes of a coordinate system as its program sees them, in user units."""

    def __init__(self, values: SystemVariables, modes: Modes, positions: Mapping[str, float]) -> None:
        """Take `positions`, the commanded positions of the defined axes at the start."""
        self.times = MoveTimes(values.store, modes, values.number)
        self._values = values
        self._modes = modes
        self._positions = dict(positions)
        self._deferred: dict[tuple[VariableKind, int], requests.DeferredValue] = {}

    @property
    def positions(self) -> Mapping[str, float]:
        """The axis positions at the end of the last request."""
        return self._positions

    def relocate(self, positions: Mapping[str, float]) -> None:
        """Set axis positions that differ from the last move's target."""
        self._positions = {**self._positions, **positions}  # the old one belongs to the last request

    def select(self, statement: SelectMode | Positioning | Feedrate) -> None:
        """Execute a modal word without a value."""
        match statement:
            case SelectMode(mode):
                self._modes.mode = mode
            case Positioning():
                self._modes.position(statement, set(self._positions))
            case Feedrate():
                self._modes.feed(statement, set(self._positions))

    def turn(self, words: Sequence[Word]) -> None:
        """NORMAL. Raises PmacError: 003, a vector of zero length has no direction."""
        normal = {letter: value(self._values) for letter, value, _ in words}
        if not any(normal.values()):
            raise PmacError(ErrorCode.DATA_ERROR, "NORMAL 0 has no direction")
        self._modes.turn(normal)

    def defer(self, kind: VariableKind, index: int, value: float, operator: str) -> None:
        """Defer an assignment to the start of the next move; a later one to the same variable replaces it."""
        place = (kind, index)
        if operator:
            waiting = self._deferred.pop(place, None)
            before = self._values.get(kind, index) if waiting is None else waiting.value
            value = evaluate.BITWISE[operator](before, value)
        self._deferred[place] = requests.DeferredValue(kind=kind, index=index, value=value)

    def move(self, line: int, words: Sequence[Word]) -> requests.MoveRequest | None:
        """Return the request for the move of a line; None when it names nothing that can move."""
        targets = dict(self._positions)
        values, incremental = self._values, self._modes.incremental
        absolute: list[str] = []
        velocities: dict[str, float] = {}
        vector: dict[str, float] = {}
        for letter, value, velocity in words:
            if letter in targets:
                if letter in incremental:
                    targets[letter] += value(values)
                else:
                    targets[letter] = value(values)
                    absolute.append(letter)
                if velocity is not None:
                    velocities[letter] = velocity(values)
            elif letter == _RADIUS or letter in VECTOR:
                vector[letter] = value(values)
            # An axis without a motor: the word has no effect.
        mode = self._modes.mode
        if len(vector) == len(words) and mode not in _CIRCLES:
            return None  # only the vector of a circle, in a mode without circles
        aim = _Aim(line, self._positions, targets, frozenset(absolute))
        self._positions = targets
        if mode == "PVT":
            return self._pvt(aim, velocities)
        if velocities:
            raise PmacError(ErrorCode.DATA_ERROR, "an end velocity belongs to PVT moves")
        if mode == "LINEAR" or (mode in _CIRCLES and not vector):
            return self._linear(aim, self.times.linear_ms(aim.start, targets))
        return self._request(mode, aim, words, vector)

    def move_until_trigger(
        self, line: int, words: Sequence[Word], past: Sequence[tuple[str, Value]]
    ) -> requests.TriggerRequest | None:
        """`X10^1`. Raises PmacError: 003, not in RAPID mode."""
        if self._modes.mode != "RAPID":
            raise PmacError(ErrorCode.DATA_ERROR, "a move until a trigger (X10^1) belongs to RAPID moves")
        request = self.move(line, words)
        if not isinstance(request, requests.RapidRequest):
            return None
        return requests.TriggerRequest(
            line=line,
            targets=request.targets,
            absolute=request.absolute,
            deferred=request.deferred,
            moving=request.moving,
            past_trigger={axis: value(self._values) for axis, value in past if axis in request.targets},
        )

    def delay(self, line: int, duration_ms: float) -> requests.LinearRequest:
        """DELAY: a LINEAR move of zero distance."""
        here = self._positions
        return self._linear(_Aim(line, here, dict(here), frozenset()), max(0.0, duration_ms))

    def dwell(self, duration_ms: float) -> requests.DwellRequest:
        """DWELL."""
        return requests.DwellRequest(duration_ms=max(0.0, duration_ms), deferred=self._take_deferred())

    def preset(self, line: int, words: Sequence[Word]) -> requests.PresetRequest:
        """PSET; axes without a motor are left out."""
        positions = {letter: value(self._values) for letter, value, _ in words if letter in self._positions}
        self.relocate(positions)
        return requests.PresetRequest(line=line, positions=positions)

    def home(self, line: int, motors: tuple[int, ...], zero: bool) -> requests.HomeRequest:
        """HOME or HOMEZ. Raises PmacError: 003, the controller has no such motor."""
        count = self._values.store.dialect.motor_count
        if max(motors) > count:
            raise PmacError(ErrorCode.DATA_ERROR, f"HOME{max(motors)}, motors 1 to {count}")
        return requests.HomeRequest(line=line, motors=motors, zero=zero)

    def _request(
        self, mode: str, aim: _Aim, words: Sequence[Word], vector: Mapping[str, float]
    ) -> requests.MoveRequest | None:
        if mode in _CIRCLES:
            return self._circle(aim, vector)
        if mode in _SPLINES:
            duration_ms = self.times.spline_ms()
            return requests.SplineRequest(duration_ms=duration_ms, uniform=mode == "SPLINE1", **self._common(aim))
        moving = frozenset(letter for letter, _, _ in words if letter in aim.targets)
        return requests.RapidRequest(moving=moving, **self._common(aim)) if moving else None

    def _linear(self, aim: _Aim, tm_ms: float) -> requests.LinearRequest:
        return requests.LinearRequest(
            line=aim.line,
            targets=aim.targets,
            absolute=aim.absolute,
            deferred=self._take_deferred(),
            ta_ms=self.times.ta_ms,
            ts_ms=self.times.ts_ms,
            tm_ms=tm_ms,
        )

    def _pvt(self, aim: _Aim, velocities: Mapping[str, float]) -> requests.PvtRequest:
        unit_ms = self.times.unit_ms
        per_ms = {axis: velocity / unit_ms for axis, velocity in velocities.items()}
        return requests.PvtRequest(
            line=aim.line,
            targets=aim.targets,
            absolute=aim.absolute,
            duration_ms=self.times.pvt_ms(),
            deferred=self._take_deferred(),
            velocities=per_ms,
        )

    def _circle(self, aim: _Aim, vector: Mapping[str, float]) -> requests.CircleRequest:
        """A vector takes precedence over a radius on the same line."""
        tm_ms, speed_per_ms = self.times.arc()
        parts = {axis: vector[letter] for letter, axis in zip(VECTOR, "XYZ", strict=True) if letter in vector}
        if not self._modes.radius_incremental:
            parts = {axis: place - aim.start.get(axis, 0.0) for axis, place in parts.items()}
        return requests.CircleRequest(
            clockwise=self._modes.mode == "CIRCLE1",
            normal=self._modes.normal,
            center={axis: parts.get(axis, 0.0) for axis in "XYZ"} if parts else None,
            radius=None if parts else vector[_RADIUS],
            ta_ms=self.times.ta_ms,
            ts_ms=self.times.ts_ms,
            tm_ms=tm_ms,
            speed_per_ms=speed_per_ms,
            **self._common(aim),
        )

    def _common(self, aim: _Aim) -> _Common:
        return {
            "line": aim.line,
            "targets": aim.targets,
            "absolute": aim.absolute,
            "deferred": self._take_deferred(),
        }

    def _take_deferred(self) -> tuple[requests.DeferredValue, ...]:
        if not self._deferred:
            return ()
        taken = tuple(self._deferred.values())
        self._deferred.clear()
        return taken


@dataclass(frozen=True, slots=True)
class StepMaker:
    """Compiles the steps of one run."""

    moves: Moves
    values: SystemVariables
    host: ProgramHost
    compile_value: Callable[[syntax.Expression], Value]
    python: PythonText | None

    def step(self, statement: Plain, line: int) -> Step:  # noqa: C901 - one branch a case
        """Return the function that executes a statement of a line."""
        moves, values = self.moves, self.values
        match statement:
            case syntax.Assign():
                return self._assign(statement)
            case syntax.Move():
                return self._move(statement, line)
            case syntax.Set(word, expression):
                value = self.compile_value(expression)
                return lambda: moves.times.keep(word, value(values))
            case syntax.Wait():
                return self._wait(statement, line)
            case syntax.SelectMode() | syntax.Positioning() | syntax.Feedrate():
                return lambda: moves.select(statement)
            case syntax.Normal():
                words = self._words(statement.words)
                return lambda: moves.turn(words)
            case syntax.Preset():
                words = self._words(statement.words)
                return lambda: moves.preset(line, words)
            case syntax.HomeMotors():
                return lambda: moves.home(line, statement.motors, statement.zero)
            case syntax.Argument(letter, expression):
                value = self.compile_value(expression)
                return lambda: values.set(VariableKind.Q, _SPINDLE_SPEED, value(values)) if letter == "S" else None
            case syntax.Message():
                return lambda: self._say(statement)
            case syntax.PlcSwitch():
                return lambda: self.host.switch_plc(statement.enable, statement.numbers, statement.keeping)

    def _assign(self, statement: syntax.Assign) -> Step:
        value, values, target = self.compile_value(statement.value), self.values, statement.target
        kind, index = target.kind, self.compile_value(target.index)
        if statement.synchronous:
            return lambda: self.moves.defer(kind, int(index(values)), value(values), statement.operator)
        if isinstance(target.index, syntax.Number):
            fixed = int(target.index.value)
            return lambda: values.set(kind, fixed, value(values))
        return lambda: values.set(kind, int(index(values)), value(values))

    def _move(self, statement: syntax.Move, line: int) -> Step:
        moves, words = self.moves, self._words(statement.words)
        past = [(w.axis, self.compile_value(w.past_trigger)) for w in statement.words if w.past_trigger]
        if past:
            return lambda: moves.move_until_trigger(line, words, past)
        times = 0

        def step() -> Request | None:
            nonlocal words, times
            times += 1
            if times == WORTH:
                words = self._repeated_words(statement.words) or words
            return moves.move(line, words)

        return step

    def _repeated_words(self, words: Sequence[syntax.AxisWord]) -> list[Word] | None:
        """Return words of a line that is executed again and again."""
        expressions = [each for w in words for each in (w.value, w.velocity) if each is not None]
        if self.python is None or (functions := self.python.values(expressions)) is None:
            return None
        value = iter(functions)
        return [(w.axis, next(value), next(value) if w.velocity is not None else None) for w in words]

    def _words(self, words: Sequence[syntax.AxisWord]) -> list[Word]:
        value_of = self.compile_value
        return [(w.axis, value_of(w.value), value_of(w.velocity) if w.velocity else None) for w in words]

    def _wait(self, statement: syntax.Wait, line: int) -> Step:
        duration, values = self.compile_value(statement.duration_ms), self.values
        if statement.word == "DELAY":
            return lambda: self.moves.delay(line, duration(values))
        return lambda: self.moves.dwell(duration(values))

    def _say(self, statement: syntax.Message) -> None:
        match statement.word:
            case "CMD":
                self.host.command(statement.text, statement.port)
            case "SEND":
                self.host.send(statement.text, statement.port)
            case _:
                self.host.display(statement.text)
