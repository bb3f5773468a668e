"""Execute a PLC, one scan at a time, and the timers that PLCs and programs wait by.

An ENDWHILE ends the scan, and the next one continues with its WHILE (PMAC User Manual, PLC Programs 1-31). So
every scan ends: inside it there is no way back, and each statement is executed at most once.

PLC 0 runs in the foreground, a scan at each real-time interrupt; PLC 1 to 31 run in the background, a scan each in
the order of their numbers. I5 permits the one or the other; a PLC that it permits must also be enabled.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, replace

from drivers.pmac.dialect import Dialect
from drivers.pmac.language import syntax
from drivers.pmac.language.blocks import Blocks, Enter
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.evaluate import Value, compile_condition, compile_expression
from drivers.pmac.language.plc_statements import PlcCode
from drivers.pmac.language.python_text import PythonText
from drivers.pmac.requests import DefaultAddress, ProgramHost
from drivers.pmac.variables import SystemVariables, VariableStore

I5_FOREGROUND = 1
I5_BACKGROUND = 2
"""The bits of I5."""

FOREGROUND_PLC = 0

_ANGLE_UNIT = 15  # I15: 0 is degrees

_Step = Callable[[], int | None]
"""Executes an instruction and returns the place of the next one; None: the one after it."""

LOWEST_COUNT = -(2**23)  # Timers saturate here; they do not roll over (Turbo Software Reference, Isx11)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlcFault:
    """A run-time error: its line (from 0), the number of ERRnnn, and the cause in readable form."""

    line: int
    code: int
    detail: str


class PlcRun:
    """The state of one PLC from scan to scan."""

    def __init__(
        self, code: PlcCode, variables: VariableStore, host: ProgramHost, addressed: DefaultAddress | None = None
    ) -> None:
        """Set `addressed` to what an earlier text of the same PLC has left; at power-up it is #1 and &1."""
        self.addressed = addressed or DefaultAddress()
        self._code = code
        self._variables = variables
        self._host = host
        self._values: SystemVariables = variables.view(self.addressed.system)
        self._degrees = True
        self._steps: list[_Step] = []
        self._blocks: list[Enter | None] = []
        self._place = 0  # the instruction that is executed
        self._counter = 0

    @property
    def line(self) -> int:
        """The line at which the next scan begins, from 0."""
        lines = self._code.line_of
        return lines[self._counter] if lines else 0

    def restart(self) -> None:
        """Begin the next scan at the top; the addressed motor and system stay."""
        self._counter = 0

    def scan(self) -> PlcFault | None:
        """Execute one scan; return the run-time error that has ended it: the PLC, at its top, is then disabled."""
        # Recompile when I15, the unit of angles, differs from the last scan.
        degrees = self._variables.i(_ANGLE_UNIT) == 0
        if not self._steps or degrees != self._degrees:
            self._degrees = degrees
            self._steps = [self._step(place) for place in range(len(self._code.instructions))]
            self._blocks = self._new_blocks()
        steps, place = self._steps, self._counter
        self._counter, end = 0, len(steps)
        while place < end:
            self._place = place
            try:
                enter = self._blocks[place]
                if enter is not None and (done := enter(self._values)) is not None:
                    place = done[0]  # always further on
                    continue
                target = steps[place]()
            except PmacError as error:
                return PlcFault(line=self._code.line_of[self._place], code=error.code, detail=error.detail)
            following = place + 1 if target is None else target
            if following <= place:
                self._counter = following
                return None
            place = following
        return None

    def _new_blocks(self) -> list[Enter | None]:
        """Return what can be executed in one go, by its first instruction."""
        instructions, p_values = self._code.instructions, self._variables.p_values
        if p_values is None:
            return [None] * len(instructions)

        def failed(place: int) -> None:
            self._place = place

        return Blocks(
            instructions, self._code.jumps, PythonText(p_values, self._degrees, strict=False), failed
        ).enter

    def _step(self, place: int) -> _Step:
        statement, target = self._code.instructions[place], self._code.jumps[place]
        match statement:
            case syntax.While() | syntax.If():
                holds = compile_condition(statement.condition, self._degrees, strict=False)
                return lambda: None if holds(self._values) else target
            case syntax.EndWhile() | syntax.Else():
                return lambda: target
            case syntax.EndIf():
                return lambda: None
            case syntax.Assign():
                kind, number = statement.target.kind, statement.target.index
                index, value = self._value(number), self._value(statement.value)
                if isinstance(number, syntax.Number):
                    fixed = int(number.value)
                    return lambda: self._values.set(kind, fixed, value(self._values))
                return lambda: self._values.set(kind, int(index(self._values)), value(self._values))
            case syntax.Message():
                return lambda: self._say(statement)
            case syntax.PlcSwitch():
                return lambda: self._host.switch_plc(statement.enable, statement.numbers, statement.keeping)
            case syntax.Address():
                return lambda: self._address(statement)

    def _say(self, statement: syntax.Message) -> None:
        match statement.word:
            case "CMD":
                self._host.command(statement.text, statement.port, self.addressed)
            case "SEND":
                self._host.send(statement.text, statement.port)
            case _:
                self._host.display(statement.text)

    def _address(self, statement: syntax.Address) -> None:
        dialect = self._variables.dialect
        motor, system = self._number(statement.motor), self._number(statement.system)
        if motor is not None:
            _require("motor", motor, dialect.motor_count)
            self.addressed = replace(self.addressed, motor=motor)
        if system is not None:
            _require("coordinate system", system, dialect.system_count)
            self.addressed = replace(self.addressed, system=system)
            self._values = self._variables.view(system)

    def _number(self, number: int | syntax.Variable | None) -> int | None:
        return int(self._value(number)(self._values)) if isinstance(number, syntax.Variable) else number

    def _value(self, expression: syntax.Expression) -> Value:
        return compile_expression(expression, self._degrees, strict=False)


def _require(what: str, number: int, highest: int) -> None:
    if not 1 <= number <= highest:
        raise PmacError(ErrorCode.DATA_ERROR, f"ADDRESS: {what} {number} does not exist; 1 to {highest}")


def timer_variables(dialect: Dialect, activation: float) -> tuple[int, ...]:
    """Return the I-variables that are running timers; `activation` is the value of `system_activation` (I68).

    Timers that are memory words (`timer_words`) are not among them, and always run.
    """
    systems = range(1, min(int(activation) + 1, dialect.system_count) + 1)
    return tuple(dialect.system_index(system, number) for system in systems for number in dialect.timer_numbers)


@dataclass(frozen=True, slots=True)
class PlcSwitches:
    """The enabled PLCs, those of them that begin at their top because they had no scan since, and the paused ones.

    A paused PLC is not enabled.
    """

    enabled: frozenset[int] = frozenset()
    at_top: frozenset[int] = frozenset()
    paused: frozenset[int] = frozenset()

    def enable(self, numbers: Iterable[int]) -> PlcSwitches:
        """ENABLE PLC: one that is already enabled continues where it is, a paused one begins at its top."""
        new = frozenset(numbers) - self.enabled
        return PlcSwitches(self.enabled | new, self.at_top | new, self.paused - new)

    def disable(self, numbers: Iterable[int]) -> PlcSwitches:
        """DISABLE PLC, OPEN PLC, control-D or a run-time error: the place in a WHILE is lost."""
        off = frozenset(numbers)
        return PlcSwitches(self.enabled - off, self.at_top - off, self.paused - off)

    def pause(self, numbers: Iterable[int]) -> PlcSwitches:
        """PAUSE PLC: one that is enabled keeps its place."""
        off = frozenset(numbers) & self.enabled
        return PlcSwitches(self.enabled - off, self.at_top, self.paused | off)

    def resume(self, numbers: Iterable[int]) -> PlcSwitches:
        """RESUME PLC: one that is paused continues; any other stays as it is."""
        new = frozenset(numbers) & self.paused
        return PlcSwitches(self.enabled | new, self.at_top, self.paused - new)

    def begin_scan(self, number: int) -> PlcSwitches:
        """Record that a PLC begins a scan: the next one continues where this one ends."""
        return PlcSwitches(self.enabled, self.at_top - {number}, self.paused)


def foreground_runs(i5: float, enabled: Collection[int], stored: Collection[int]) -> bool:
    """Whether PLC 0 has a scan at this real-time interrupt."""
    return bool(int(i5) & I5_FOREGROUND) and FOREGROUND_PLC in enabled and FOREGROUND_PLC in stored


def background_order(i5: float, enabled: Collection[int], stored: Collection[int]) -> tuple[int, ...]:
    """Return the PLCs that have a scan in this background cycle, in order.

    One that an earlier PLC of the same cycle disables is to be skipped: check `enabled` again.
    """
    if not int(i5) & I5_BACKGROUND:
        return ()
    return tuple([number for number in sorted(stored) if number != FOREGROUND_PLC and number in enabled])
