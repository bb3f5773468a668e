"""Statements that are executed in place: each is compiled to a function once, and run many times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.pmac.execution.moves import Moves, Word
from drivers.pmac.language import syntax
from drivers.pmac.language.evaluate import Value
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.requests import ProgramHost, Request
from drivers.pmac.variables import SystemVariables

Plain = (
    syntax.Modal
    | syntax.Assign
    | syntax.Move
    | syntax.Preset
    | syntax.Home
    | syntax.Wait
    | syntax.Argument
    | syntax.Message
    | syntax.PlcSwitch
)
"""The statements that do not change the order of execution."""

Step = Callable[[], Request | None]

_SPINDLE_SPEED = 127  # S alone sets this Q-variable


@dataclass(frozen=True, slots=True)
class StepMaker:
    """Compiles the steps of one run."""

    moves: Moves
    values: SystemVariables
    host: ProgramHost
    compile_value: Callable[[syntax.Expression], Value]

    def step(self, statement: Plain, line: int) -> Step:
        """Return the function that executes a statement of a line."""
        moves, values = self.moves, self.values
        match statement:
            case syntax.Assign():
                return self._assign(statement)
            case syntax.Move():
                words = self._words(statement.words)
                return lambda: moves.move(line, words)
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
            case syntax.Home():
                return lambda: moves.home(line, statement.motors, statement.zero)
            case syntax.Argument(letter, expression):
                value = self.compile_value(expression)
                return lambda: values.set(VariableKind.Q, _SPINDLE_SPEED, value(values)) if letter == "S" else None
            case syntax.Message():
                return lambda: self._say(statement)
            case syntax.PlcSwitch():
                return lambda: self.host.switch_plc(statement.enable, statement.numbers)

    def _assign(self, statement: syntax.Assign) -> Step:
        value, values, target = self.compile_value(statement.value), self.values, statement.target
        kind, index = target.kind, self.compile_value(target.index)
        if statement.synchronous:
            return lambda: self.moves.defer(kind, int(index(values)), value(values), statement.operator)
        if isinstance(target.index, syntax.Number):
            fixed = int(target.index.value)
            return lambda: values.set(kind, fixed, value(values))
        return lambda: values.set(kind, int(index(values)), value(values))

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
