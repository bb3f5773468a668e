"""On-line commands: one line of text from a host, executed command by command.

Several commands may stand in a line with or without separators; what was done before an error stays done.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.pmac.axes import scan_definition
from drivers.pmac.dialect import PMAC
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.expressions import parse_expression
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.language.text import format_number
from drivers.simulator import buffers, reports
from drivers.simulator.context import Context

RANGE_LIMIT = 1024
"""Variables that one range may name."""


def execute(text: str, context: Context) -> None:
    """Execute one line; data for the host is appended to `context.lines`.

    Raises:
        PmacError: the command at which execution stopped.
    """
    scanner = Scanner(text)
    while not scanner.at_end:
        _command(scanner, text, context)


def _command(scanner: Scanner, text: str, context: Context) -> None:
    word = scanner.take_word(_COMMAND_WORDS)
    if word is not None:
        COMMANDS[word](scanner, context)
        return
    if context.fills_buffer:
        buffers.store(scanner, text, context)
        return
    if _variable(scanner, context):
        return
    letter = scanner.take_word(_LETTERS)
    if letter is not None:
        _PLAIN[letter](scanner, context)
        return
    if buffers.is_program_text(scanner.rest):
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, scanner.rest[:20])
    raise scanner.refusal("no such command")


def _address_motor(scanner: Scanner, context: Context) -> None:
    number = scanner.take_integer()
    if number is None:
        context.lines.append(str(context.motor_number))
        return
    if not 1 <= number <= PMAC.motor_count:
        raise PmacError(ErrorCode.DATA_ERROR, f"motor {number}, 1 to {PMAC.motor_count}")
    if scanner.accept("->"):
        _define_axis(scanner, context, number)
        return
    context.motor_number = number


def _define_axis(scanner: Scanner, context: Context, motor: int) -> None:
    controller = context.controller
    if scanner.at_end or scanner.peek("#&") or scanner.accept(","):
        system = controller.system_of(motor)
        definition = system.definitions[motor] if system is not None else 0
        context.lines.append(str(definition))
        return
    controller.define_axis(context.system_number, motor, scan_definition(scanner, motor))


def _address_system(scanner: Scanner, context: Context) -> None:
    number = scanner.take_integer()
    if number is None:
        context.lines.append(str(context.system_number))
    elif number in context.controller.systems:
        context.system_number = number
    else:
        raise PmacError(ErrorCode.DATA_ERROR, f"&{number}, 1 to {len(context.controller.systems)}")


def _variable(scanner: Scanner, context: Context) -> bool:
    """Answer or assign `P1`, `P1..3`, `P1,3,2`; False when none stands at the cursor."""
    start = scanner.mark()
    kind = scanner.take_word(_KINDS)
    first = scanner.take_integer() if kind is not None else None
    if kind is None or (first is None and not (kind != "P" and scanner.peek("("))):
        scanner.reset(start)
        return False
    if first is None:
        first = int(_parenthesised(scanner, context))
    indices = _indices(scanner, first)
    variables = context.controller.variables
    if scanner.accept("="):
        value = evaluate(parse_expression(scanner), variables, degrees=variables.i(15) == 0, strict=False)
        for index in indices:
            variables.set(VariableKind(kind), index, value)
        return True
    context.lines.extend(format_number(variables.get(VariableKind(kind), index)) for index in indices)
    return True


def _parenthesised(scanner: Scanner, context: Context) -> float:
    variables = context.controller.variables
    scanner.expect("(")
    value = evaluate(parse_expression(scanner), variables, degrees=variables.i(15) == 0, strict=False)
    scanner.expect(")")
    return value


def _indices(scanner: Scanner, first: int) -> range:
    if scanner.accept(".."):
        last = scanner.take_integer()
        if last is None or last < first or last - first >= RANGE_LIMIT:
            raise scanner.refusal("a range as in P1..3")
        return range(first, last + 1)
    if scanner.peek(","):
        scanner.expect(",")
        count = scanner.take_integer()
        scanner.expect(",")
        step = scanner.take_integer()
        if not count or not step or count > RANGE_LIMIT:
            raise scanner.refusal("start, count, step as in P1,3,2")
        return range(first, first + count * step, step)
    return range(first, first + 1)


def _jog(scanner: Scanner, context: Context) -> None:
    motor = context.motor
    system = context.controller.system_of(motor.number)
    if system is not None and (system.running or system.moving):
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"#{motor.number} is moved by &{system.number}")
    if scanner.accept("+"):
        motor.jog_speed(1)
    elif scanner.accept("-"):
        motor.jog_speed(-1)
    elif scanner.accept("/"):
        motor.jog_speed(0)
    elif scanner.accept("="):
        target = _signed(scanner)
        if target is None:
            motor.jog_back()
        else:
            motor.jog_to(target)
    elif scanner.accept("^"):
        distance = _signed(scanner)
        if distance is None:
            raise scanner.refusal("a distance as in J^1000")
        motor.jog_to(motor.encoder + distance)
    else:
        raise scanner.refusal("J+ J- J/ J= or J^")


def _signed(scanner: Scanner) -> float | None:
    start = scanner.mark()
    negative = scanner.accept("-")
    value = scanner.take_number()
    if value is None:
        scanner.reset(start)
        return None
    return -value if negative else value


def _home(_: Scanner, context: Context) -> None:
    motor = context.motor
    system = context.controller.system_of(motor.number)
    if system is not None and (system.running or system.moving):
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"#{motor.number} is moved by &{system.number}")
    motor.home()


def _kill(_: Scanner, context: Context) -> None:
    motor = context.motor
    system = context.controller.system_of(motor.number)
    if system is not None and (system.running or system.moving):
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"#{motor.number}: abort first, or control-K")
    motor.kill()


def _point(scanner: Scanner, context: Context) -> None:
    number = scanner.take_integer()
    if number is None:
        raise scanner.refusal("a program number as in B1")
    context.controller.systems[context.system_number].program_number = number


def _run(_: Scanner, context: Context) -> None:
    if context.controller.open_buffer is not None:
        raise PmacError(ErrorCode.NO_PROGRAM, "a program buffer is open")
    context.controller.start_program(context.system_number)


def _quit(_: Scanner, context: Context) -> None:
    context.controller.systems[context.system_number].quit()


def _abort(_: Scanner, context: Context) -> None:
    context.controller.systems[context.system_number].abort()


def _reset(_: Scanner, context: Context) -> None:
    context.controller.reset()


def _factory_reset(_: Scanner, context: Context) -> None:
    context.controller.reset(PMAC.factory)


def _say(report: Callable[[Context], str]) -> Callable[[Scanner, Context], None]:
    def command(_: Scanner, context: Context) -> None:
        context.lines.append(report(context))

    return command


_Handler = Callable[[Scanner, Context], None]

COMMANDS: dict[str, _Handler] = {
    "#": _address_motor,
    "&": _address_system,
    "?": _say(lambda context: reports.motor_status(context.controller, context.motor)),
    "??": _say(lambda context: reports.system_status(context.controller, context.system_number)),
    "???": _say(lambda context: reports.global_status(context.controller)),
    "J": _jog,
    "HM": _home,
    "HOME": _home,
    "VERSION": _say(lambda _: PMAC.replies["VERSION"]),
    "VER": _say(lambda _: PMAC.replies["VERSION"]),
    "TYPE": _say(lambda _: PMAC.replies["TYPE"]),
    "OPENPROG": buffers.open_program,
    "CLEAR": buffers.clear_program,
    "CLR": buffers.clear_program,
    "CLOSE": buffers.close_program,
    "LISTPROG": buffers.list_program,
    "DELETE": buffers.delete,
    "$$$***": _factory_reset,
    "$$$": _reset,
}
"""Words that are unmistakable; the longest that fits wins."""

_PLAIN: dict[str, _Handler] = {
    "P": _say(lambda context: reports.position(context.motor)),
    "V": _say(lambda context: reports.velocity(context.motor)),
    "F": _say(lambda context: reports.following_error(context.motor)),
    "K": _kill,
    "B": _point,
    "R": _run,
    "Q": _quit,
    "A": _abort,
}
"""Single letters, looked for after the variables that begin with the same letter."""

_COMMAND_WORDS = tuple(COMMANDS)
_LETTERS = tuple(_PLAIN)
_KINDS = tuple(str(kind) for kind in VariableKind)
