"""The addressing of one host with its pending data, and how its commands are read before they act."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import Expression
from drivers.pmac.variables import SystemVariables
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.motor import Motor

ALL_CARDS = -1  # `@@`: every controller on the line is addressed
HIGHEST_CARD = 15  # controllers on one line are numbered from 0
LINE_WORK = 16  # cost of writing or storing a program line, in variables read


@dataclass(slots=True, eq=False)
class Context:
    """The addressing of one port. Two ports are never equal, however alike.

    `motor_bank` is the group of eight motors that the control characters report, from 0. `card_number` is the
    controller addressed with `@n`, None before any was. `work` is the cost of its commands: values read or set,
    and lines of data.
    """

    controller: SimulatedController
    motor_number: int = 1
    system_number: int = 1
    motor_bank: int = 0
    card_number: int | None = None
    lines: list[str] = field(default_factory=list)
    work: int = 0

    @property
    def dialect(self) -> Dialect:
        """The family of the controller."""
        return self.controller.dialect

    @property
    def motor(self) -> Motor:
        """The addressed motor."""
        return self.controller.motors[self.motor_number]

    @property
    def active_motor(self) -> Motor:
        """The addressed motor, checked to be movable. Raises PmacError: 013, it is not activated."""
        motor = self.motor
        if not motor.activated:
            raise PmacError(ErrorCode.NOT_ACTIVATED, f"motor {self.motor_number}")
        return motor

    @property
    def system(self) -> CoordinateSystem:
        """The addressed coordinate system."""
        return self.controller.systems[self.system_number]

    @property
    def variables(self) -> SystemVariables:
        """The variables, with Q of the addressed coordinate system."""
        return self.controller.variables.view(self.system_number)

    @property
    def fills_buffer(self) -> bool:
        """Whether program text from this host goes into the open buffer."""
        return self.filling is not None

    @property
    def filling(self) -> BufferKind | None:
        """What program text from this host fills, None where commands act at once."""
        opened = self.controller.open_buffer
        return opened.kind if opened is not None and opened.owner is self else None

    def value(self, expression: Expression) -> float:
        """Return the value of an expression. Raises PmacError: 003, it has none."""
        degrees = self.controller.variables.i(15) == 0
        return evaluate(expression, self.variables, degrees, strict=False)

    @property
    def in_full(self) -> bool:
        """Whether listings and reports of I-variables and M-definitions are whole statements (bit 0 of I9)."""
        return bool(int(self.controller.variables.i(9)) & 1)

    def list_lines(self, lines: Sequence[str]) -> None:
        """Reply with lines of a listing."""
        self.work += len(lines) * LINE_WORK
        self.lines += lines


Step = Callable[[Context], None]  # a command that was read: it acts for its host


@dataclass(slots=True)
class LineContext:
    """What the reading of a line depends on: its text, as typed, the family, and where program text goes."""

    text: str
    dialect: Dialect
    filling: BufferKind | None = None

    @property
    def fills(self) -> bool:
        """Whether program text goes into a buffer."""
        return self.filling is not None


Handler = Callable[[Scanner, LineContext], Step]
"""Reads the arguments of a command. Nothing acts before the whole line has been read."""


def say(report: Callable[[Context], str]) -> Handler:
    """Return a command that replies one line."""
    return act(lambda context: context.lines.append(report(context)))


def act(action: Callable[[Context], object]) -> Handler:
    """Return a command without arguments."""

    def step(context: Context) -> None:
        action(context)

    return lambda scanner, reading: step


def signed_constant(scanner: Scanner) -> float | None:
    """Consume a constant, negative or not; None, with nothing consumed, when there is none at the cursor."""
    start = scanner.mark()
    negative = scanner.accept("-")
    value = scanner.take_number()
    if value is None:
        scanner.reset(start)
        return None
    return -value if negative else value
