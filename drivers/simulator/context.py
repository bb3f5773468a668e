"""The addressing of one host with its pending data, and the form of a command that acts for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.expressions import parse_expression
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.variables import SystemVariables
from drivers.simulator.card.controller import Controller
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.motor import Motor

ALL_CARDS = -1  # `@@`: every controller on the line is addressed
HIGHEST_CARD = 15  # controllers on one line are numbered from 0
LINE_WORK = 16  # cost of writing or storing a program line, in variables read


@dataclass(slots=True, eq=False)
class Context:
    """The addressing of one port. Two ports are never equal, however alike.

    `motor_bank` is the group of eight motors that the control characters report, from 0. `card_number` is the
    controller addressed with `@n`, None before any was. `text` is the line being executed, as typed. `work` is the
    cost of its commands: values read or set, and lines of data.
    """

    controller: Controller
    motor_number: int = 1
    system_number: int = 1
    motor_bank: int = 0
    card_number: int | None = None
    text: str = ""
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
        opened = self.controller.open_buffer
        return opened is not None and opened.owner is self

    def expression(self, scanner: Scanner) -> float:
        """Parse an expression; return its value. Raises PmacError: 003, no expression, or one without a value."""
        degrees = self.controller.variables.i(15) == 0
        return evaluate(parse_expression(scanner), self.variables, degrees, strict=False)

    def list_lines(self, lines: list[str]) -> None:
        """Reply with lines of a listing."""
        self.work += len(lines) * LINE_WORK
        self.lines += lines


Handler = Callable[[Scanner, Context], None]  # a command: parses its own arguments, acts for its host


def say(report: Callable[[Context], str]) -> Handler:
    """Return a command that replies one line."""
    return lambda _, context: context.lines.append(report(context))


def act(action: Callable[[Context], object]) -> Handler:
    """Return a command without arguments."""

    def command(_: Scanner, context: Context) -> None:
        action(context)

    return command


def signed_constant(scanner: Scanner) -> float | None:
    """Consume a constant, negative or not; None, with nothing consumed, when there is none at the cursor."""
    start = scanner.mark()
    negative = scanner.accept("-")
    value = scanner.take_number()
    if value is None:
        scanner.reset(start)
        return None
    return -value if negative else value
