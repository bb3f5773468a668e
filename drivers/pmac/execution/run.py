"""Execute a motion program: from statements to requests for motion, one at a time.

Serves the simulator, which plays the requests, and the checker, which only plots them. It knows axes in user
units, not motors. Calculation happens when a request is asked for, one move ahead of the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import takewhile
from typing import TypeVar

from drivers.pmac.execution.calls import Arguments, CallingLine, target_of
from drivers.pmac.execution.move_times import Modes
from drivers.pmac.execution.moves import Moves, Step, StepMaker
from drivers.pmac.language import syntax
from drivers.pmac.language.blocks import LONGEST, Blocks, Enter
from drivers.pmac.language.errors import ErrorCode, NoResultError, PmacError
from drivers.pmac.language.evaluate import Value, Variables, compile_condition, compile_expression
from drivers.pmac.language.parser import may_be_argument
from drivers.pmac.language.python_text import PythonText
from drivers.pmac.language.structure import NO_JUMP, ExecutableProgram
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.requests import BlendBreak, EndOfProgram, Halt, NoHost, ProgramHost, Request
from drivers.pmac.variables import VariableStore

_Result = TypeVar("_Result", float, bool)

JUMPS_THAT_BREAK_BLENDING = 2  # Backward jumps while searching for the next move after which the motion may stop

STEPS_PER_LOOK = 10_000
"""Statements without a move after which the motion may stop, too: no program blocks the controller."""

DEEPEST_CALL = 15  # Maximum nesting of GOSUB and CALL

_READ_FLAGS = 100
_FIRST_LETTER = "A"

Library = Callable[[int], ExecutableProgram | None]


@dataclass(frozen=True, slots=True)
class _Unit:
    """A program, or the rest of a calling line, ready to run."""

    code: ExecutableProgram
    steps: list[Step]
    blocks: list[Enter | None]
    program: int


@dataclass(slots=True)
class _Frame:
    """The execution state of a unit; `called` unless it is the first one or the rest of a calling line."""

    unit: _Unit
    counter: int = 0
    called: bool = False
    arguments: Arguments | None = None


class ProgramRun:
    """One running program, from its first statement to `EndOfProgram`."""

    def __init__(
        self,
        code: ExecutableProgram,
        variables: VariableStore,
        modes: Modes,
        positions: Mapping[str, float],
        system: int = 1,
        strict: bool = True,
        *,
        library: Library = lambda _: None,
        host: ProgramHost | None = None,
        label: int | None = None,
        number: int = 0,
        on_substitute: Callable[[str], None] | None = None,
    ) -> None:
        """Take `positions`, the commanded positions of the defined axes at the start, in user units.

        `strict` makes arithmetic without a result an error; the controller continues with a substitute. With
        `on_substitute`, for the checker, the run continues, too, and each substitute is reported. `library` gives
        the programs that are called, `number` is that of `code`, if known. Begins at `label`.

        Raises PmacError: 015, there is no such label.
        """
        self.line = 0
        self.in_block = False
        self.single_step = False
        self._values = variables.view(system)
        self._degrees = variables.i(15) == 0
        self._strict = strict
        self._on_substitute = on_substitute
        self._library = library
        self._host = host or NoHost()
        self._moves = Moves(self._values, modes, positions)
        p_values = None if on_substitute else variables.p_values
        self._python = None if p_values is None else PythonText(p_values, self._degrees, strict)
        self._maker = StepMaker(self._moves, self._values, self._host, self._expression, self._python)
        self._units: dict[int, _Unit | None] = {}
        self._rests: dict[tuple[CallingLine, int], _Unit] = {}
        self._jumps_back = 0
        self._depth = 0
        start = 0 if label is None else code.find(label)
        if start is None:
            raise PmacError(ErrorCode.NO_PROGRAM, f"N{label} does not exist")
        unit = self._unit_of(code, number)
        if number:
            self._units[number] = unit
        self._frame = _Frame(unit, start)
        self._frames = [self._frame]

    @property
    def program(self) -> int:
        """The number of the program that is executed; 0 for the first one if it is not known."""
        return self._frame.unit.program

    @property
    def first_line(self) -> int:
        """The line of the first program that is executed, or that has made the present call."""
        frame = self._frames[0]
        if frame is self._frame:
            return self.line  # the counter may be at the WHILE to which an ENDWHILE has just led back
        lines = frame.unit.code.line_of
        return lines[max(0, frame.counter - 1)] if lines else 0

    def place(self) -> tuple[int, ...]:
        """Return the state of the program and its callers as opaque numbers.

        With equal places and equal values of all variables, it continues alike.
        """
        return tuple(
            number
            for frame in self._frames
            for number in (id(frame.unit), frame.counter, frame.arguments.taken if frame.arguments else 0)
        )

    def rewind(self) -> None:
        """Begin again at the first statement."""
        del self._frames[1:]
        self._frame = self._frames[0]
        self._frame.counter = self._depth = 0

    @property
    def positions(self) -> Mapping[str, float]:
        """The axis positions at the end of the last request."""
        return self._moves.positions

    def relocate(self, positions: Mapping[str, float]) -> None:
        """Set the axes to `positions`: after a HOME, a PSET or a motion commanded elsewhere."""
        self._moves.relocate(positions)

    def advance(self) -> Request:
        """Calculate up to the next request for motion.

        Raises PmacError: a run-time error of the program; the caller stops it.
        """
        self._jumps_back, left = 0, STEPS_PER_LOOK
        while left > 0:
            frame = self._frame
            index = frame.counter
            unit = frame.unit
            if index >= len(unit.steps):
                if not self._leave():
                    return EndOfProgram()
                left -= 1
                continue
            enter = unit.blocks[index]
            if enter is not None and left >= LONGEST and (done := enter(self._values)) is not None:
                frame.counter, last = done
                self.line = unit.code.line_of[last]
                left -= last + 1 - index
                continue
            left -= 1
            self.line = unit.code.line_of[index]
            frame.counter = index + 1
            request = unit.steps[index]()
            if request is not None:
                return request
            if self._jumps_back >= JUMPS_THAT_BREAK_BLENDING:
                return BlendBreak()
        return BlendBreak()

    def _unit_of(self, code: ExecutableProgram, program: int) -> _Unit:
        steps = [self._step(code, index) for index in range(len(code.instructions))]
        return _Unit(code, steps, self._blocks(code), program)

    def _blocks(self, code: ExecutableProgram) -> list[Enter | None]:
        """Return what can be executed in one go, by its first instruction."""
        if self._python is None:
            return [None] * len(code.instructions)

        def failed(place: int) -> None:
            self.line, self._frame.counter = code.line_of[place], place + 1

        return Blocks(code.instructions, code.jumps, self._python, failed).enter

    def _step(self, code: ExecutableProgram, index: int) -> Step:  # noqa: C901 - one branch a case
        statement = code.instructions[index]
        match statement:
            case syntax.While() | syntax.If():
                return self._branch(statement.condition, code.jumps[index])
            case syntax.EndWhile() | syntax.Else():
                target = code.jumps[index]
                return lambda: self._jump(target)
            case syntax.EndIf() | syntax.Label():
                return lambda: None
            case syntax.Goto():
                return self._goto(statement.label)
            case syntax.Gosub():
                return self._gosub(statement.label)
            case syntax.CallProgram():
                return self._call(statement, code, index)
            case syntax.Read():
                return lambda: self._read(statement.letters)
            case syntax.Return():
                return self._return
            case syntax.Block():
                return lambda: self._block(statement.begins)
            case syntax.Pause():
                return BlendBreak
            case syntax.Stop():
                return Halt
            case _:
                return self._maker.step(statement, code.line_of[index])

    def _expression(self, expression: syntax.Expression) -> Value:
        return self._compiled(compile_expression, expression)

    def _compiled(
        self, compile_part: Callable[..., Callable[[Variables], _Result]], part: object
    ) -> Callable[[Variables], _Result]:
        """Return an expression or a condition as a function; a result that is a substitute is reported."""
        strictly = compile_part(part, self._degrees, strict=self._strict)
        report = self._on_substitute
        if report is None:
            return strictly
        loosely = compile_part(part, self._degrees, strict=False)

        def result(variables: Variables) -> _Result:
            try:
                return strictly(variables)
            except NoResultError as error:
                report(error.detail)
                return loosely(variables)

        return result

    def _branch(self, condition: syntax.Condition, otherwise: int) -> Step:
        holds = self._compiled(compile_condition, condition)
        values = self._values

        def step() -> None:
            if not holds(values):
                self._frame.counter = otherwise

        return step

    def _jump(self, target: int) -> None:
        """Continue at an instruction; a way back may break blending."""
        if target < self._frame.counter:
            self._jumps_back += 1
        self._frame.counter = target

    def _block(self, begins: bool) -> Request | None:
        """End the step in single step mode: the end of a block is the end of the step."""
        self.in_block = begins
        return BlendBreak() if self.single_step and not begins else None

    def _goto(self, label: syntax.Expression) -> Step:
        value = self._expression(label)
        return lambda: self._jump(self._find(value(self._values)))

    def _gosub(self, label: syntax.Expression) -> Step:
        value = self._expression(label)
        return lambda: self._enter(_Frame(self._frame.unit, self._find(value(self._values)), called=True))

    def _find(self, value: float) -> int:
        """Return the instruction with a label in the running program."""
        label = round(value)
        target = self._frame.unit.code.find(label)
        if target is None:
            raise PmacError(ErrorCode.DATA_ERROR, f"N{label} does not exist")
        return target

    def _call(self, statement: syntax.CallProgram, code: ExecutableProgram, index: int) -> Step:
        value = self._expression(statement.target)
        calling = CallingLine(code.line_of[index], _arguments(code, index))
        after_line = index + 1 + len(calling.statements)

        def step() -> None:
            program, label = target_of(statement, value(self._values))
            self._frame.counter = after_line
            unit = self._unit(program)
            start = None if unit is None else unit.code.find(label)
            arguments = Arguments(calling)
            if unit is not None and start is not None:
                self._enter(_Frame(unit, start, called=True, arguments=arguments))
            elif statement.code:
                self._finish_line(arguments)
            else:
                raise PmacError(ErrorCode.DATA_ERROR, f"CALL {program} N{label} does not exist")

        return step

    def _unit(self, program: int) -> _Unit | None:
        if program not in self._units:
            code = self._library(program)
            self._units[program] = None if code is None else self._unit_of(code, program)
        return self._units[program]

    def _enter(self, frame: _Frame) -> None:
        if self._depth == DEEPEST_CALL:
            raise PmacError(ErrorCode.DATA_ERROR, f"more than {DEEPEST_CALL} GOSUB and CALL inside each other")
        self._depth += 1
        self._push(frame)

    def _push(self, frame: _Frame) -> None:
        self._frames.append(frame)
        self._frame = frame

    def _finish_line(self, arguments: Arguments) -> None:
        """Execute the rest of a calling line."""
        place = (arguments.calling, arguments.taken)
        unit = self._rests.get(place)
        if unit is None:
            rest = arguments.calling.rest(arguments.taken)
            code = ExecutableProgram(rest, (arguments.calling.line,) * len(rest), (NO_JUMP,) * len(rest))
            unit = self._rests[place] = self._unit_of(code, self.program)
        self._push(_Frame(unit))

    def _return(self) -> None:
        self._frame.counter = len(self._frame.unit.steps)

    def _leave(self) -> bool:
        """Return to the statement after the call; False at the end of the first program."""
        if len(self._frames) == 1:
            return False
        ended = self._frames.pop()
        self._frame = self._frames[-1]
        if ended.called:
            self._depth -= 1
        if ended.arguments is not None:
            self._finish_line(ended.arguments)
        return True

    def _read(self, letters: tuple[str, ...]) -> None:
        """Put the arguments into Q101 and following, with a bit for each present one in Q100."""
        read = next((frame.arguments for frame in reversed(self._frames) if frame.arguments is not None), None)
        flags = 0
        while read is not None and (word := read.take(letters)) is not None:
            letter, expression = word
            bit = ord(letter) - ord(_FIRST_LETTER)
            value = self._expression(expression)(self._values)
            self._values.set(VariableKind.Q, _READ_FLAGS + 1 + bit, value)
            flags |= 1 << bit
        self._values.set(VariableKind.Q, _READ_FLAGS, float(flags))


def _arguments(code: ExecutableProgram, index: int) -> tuple[syntax.Statement, ...]:
    """Return the words after a call on its line that may be its arguments."""
    line, statements = code.line_of[index], code.instructions
    following = range(index + 1, len(statements))
    places = takewhile(lambda k: code.line_of[k] == line and may_be_argument(statements[k]), following)
    return tuple(statements[place] for place in places)
