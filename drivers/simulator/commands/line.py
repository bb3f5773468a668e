"""Read one line of text from a host, whole, and execute it command by command.

A line may contain several commands, with or without separators. When any of it is not understood none of it acts;
what acts before a command is refused for another reason stays done.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

from drivers.pmac.axes import scan_definition
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner, longest_of
from drivers.pmac.language.parser import WORDS as PROGRAM_WORDS
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.card import buffers
from drivers.simulator.commands import buffer_words, status, systems, values
from drivers.simulator.context import (
    ALL_CARDS,
    HIGHEST_CARD,
    Context,
    Handler,
    LineContext,
    Step,
    signed_constant,
)

_DAISY_CHAIN = 2  # bit 1 of I1: several controllers on one line, addressed with `@n`
_COMMAND_WORK = 5  # cost of any command, in values read or set
MOTORS_IN_A_BANK = 8


def read_card(scanner: Scanner) -> int | None:
    """Read what follows `@`: the number of a card, ALL_CARDS for `@@`, or None, which reports.

    Raises PmacError: 003, a number above 15.
    """
    if scanner.accept("@"):
        return ALL_CARDS
    number = scanner.take_integer()
    if number is not None and number > HIGHEST_CARD:
        raise PmacError(ErrorCode.DATA_ERROR, f"card {number}, 0 to {HIGHEST_CARD}")
    return number


@dataclass(frozen=True, slots=True)
class AddressCard:
    """`@n`: what follows is for controller n; `@@`: for all; `@` reports. It matters only with bit 1 of I1."""

    number: int | None

    def __call__(self, context: Context) -> None:
        """Address it, or report."""
        if self.number is not None:
            context.card_number = self.number
            return
        addressed = context.card_number
        context.lines.append("@" if addressed == ALL_CARDS else str(addressed or 0))


def _address_motor(scanner: Scanner, reading: LineContext) -> Step:
    number = scanner.take_integer()
    if number is None:
        return lambda context: context.lines.append(str(context.motor_number))
    if not 1 <= number <= reading.dialect.motor_count:
        raise PmacError(ErrorCode.DATA_ERROR, f"motor {number}, 1 to {reading.dialect.motor_count}")
    if scanner.accept("->"):
        return _axis(scanner, number)

    def step(context: Context) -> None:
        context.motor_number = number

    return step


def _address_bank(scanner: Scanner, reading: LineContext) -> Step:
    """`##1`: the control characters report motors 9 to 16.

    With eight motors, and with a space between the signs, it is `#`, and `#1` after it.
    """
    banks = reading.dialect.motor_count // MOTORS_IN_A_BANK
    behind = scanner.mark()
    scanner.reset(behind - 1)
    if banks == 1 or reading.text[scanner.position - 1] != "#":
        return lambda context: context.lines.append(str(context.motor_number))
    scanner.reset(behind)
    number = scanner.take_integer()
    if number is None:
        return lambda context: context.lines.append(str(context.motor_bank))
    if number >= banks:
        raise PmacError(ErrorCode.DATA_ERROR, f"##{number}: {banks} times {MOTORS_IN_A_BANK} motors")

    def step(context: Context) -> None:
        context.motor_bank = number

    return step


def _axis(scanner: Scanner, motor: int) -> Step:
    """`#1->` reports the definition in the addressed system, 0 for a motor of another one; or define or clear."""
    if scanner.at_end or scanner.peek("#&") or scanner.accept(","):

        def report(context: Context) -> None:
            definition = context.system.frame.definitions.get(motor)
            context.lines.append("0" if definition is None else str(definition))

        return report
    definition = scan_definition(scanner, motor)

    def define(context: Context) -> None:
        if definition is not None or motor in context.system.frame.definitions:
            context.controller.define_axis(context.system_number, motor, definition)

    return define


def _address_system(scanner: Scanner, reading: LineContext) -> Step:
    number = scanner.take_integer()
    if number is None:
        return lambda context: context.lines.append(str(context.system_number))
    if not 1 <= number <= reading.dialect.system_count:
        raise PmacError(ErrorCode.DATA_ERROR, f"&{number}, 1 to {reading.dialect.system_count}")

    def step(context: Context) -> None:
        context.system_number = number

    return step


def _undefine(scanner: Scanner, reading: LineContext) -> Step:
    """UNDEFINE the axes of the addressed coordinate system, UNDEFINE ALL those of every one."""
    every = scanner.accept("ALL")

    def step(context: Context) -> None:
        controller = context.controller
        systems = list(controller.systems.values()) if every else [context.system]
        for system in systems:
            for motor in tuple(system.frame.definitions):
                controller.define_axis(system.number, motor, None)

    return step


WORDS: dict[str, Handler] = {
    "#": _address_motor,
    "##": _address_bank,
    "&": _address_system,
    **dict.fromkeys(("UNDEFINE", "UNDEF"), _undefine),
}
_ALWAYS_ON_LINE = WORDS | buffer_words.WORDS | status.CARD_WORDS | status.WORDS | systems.WORDS | values.WORDS
"""Words that are never stored, even while a buffer is open."""

# With those of programs; the longest wins.
_WORDS = _ALWAYS_ON_LINE | systems.MOTOR_WORDS | buffer_words.SHARED_WORDS
_LETTERS = status.LETTERS | systems.MOTOR_LETTERS | systems.LETTERS  # matched after the variables that begin so
_ALWAYS = longest_of(tuple(_ALWAYS_ON_LINE))
_ANY = longest_of(tuple(_WORDS))
_PROGRAM_OR_LETTER = longest_of((*PROGRAM_WORDS, *_LETTERS))

_IMMEDIATE = re.compile(r"J(?:[+/=:^]|-(?![\d.($]))|[PVFKRSHQAZ]+(?=[#&?%@]|$)|M\d+(?:\.\.\d+)?->")
"""Commands although their letters are program words: `J+` is a jog, `J-5` is part of the centre of a circle."""

MOST_REMEMBERED = 256  # lines that are read once and executed many times: what a host that polls sends


def answers(context: Context, number: int | None = None) -> bool:
    """Whether this host has addressed the controller, or would by `@number`; alone on its line, it always has."""
    variables = context.controller.variables
    if not int(variables.i(1)) & _DAISY_CHAIN:
        return True
    addressed = context.card_number if number is None else number
    return addressed in (ALL_CARDS, int(variables.i(0)) & HIGHEST_CARD)


def commands(text: str, context: Context) -> Generator[None, None, bool]:
    """Execute one line, yielding between two commands; the caller may do something else there.

    Data for the host is appended to `context.lines`, the cost of the commands is added to `context.work`.

    Returns:
        Whether the line, or a part of it, was for this controller.

    Raises PmacError: the line was not understood, and none of it has acted; or the command at which execution
        stopped.
    """
    heard = answers(context)
    if not heard and "@" not in text:
        return False
    steps = _read(text, context)
    variables, last = context.controller.variables, len(steps)
    revision = variables.i_revision
    for number, step in enumerate(steps, 1):
        # This line or another host may have changed how controllers are addressed: the rest is not for it then.
        if variables.i_revision == revision or isinstance(step, AddressCard) or answers(context):
            step(context)
        heard = heard or answers(context)
        context.work += _COMMAND_WORK
        if number < last:
            yield
    return heard


def read_line(text: str, dialect: Dialect) -> None:
    """Read a line as a controller does while no buffer is open; nothing acts. Raises PmacError: not understood."""
    _parse_stateless_line(text, dialect)


def _read(text: str, context: Context) -> tuple[Step, ...]:
    """Read a line. Raises PmacError: it was not understood."""
    filling = context.filling
    if "@" in text:
        return _parse_addressed_line(text, context)
    if filling is None and not context.controller.tables.is_filled_by(context):
        return _parse_stateless_line(text, context.dialect)
    return tuple(_commands(Scanner(text), LineContext(text, context.dialect, filling), _first_of(context)))


@lru_cache(maxsize=MOST_REMEMBERED)
def _parse_stateless_line(text: str, dialect: Dialect) -> tuple[Step, ...]:
    """Return the commands of a line that fills nothing: they depend on its text and the family alone."""
    return tuple(_commands(Scanner(text), LineContext(text, dialect), (_constant,)))


def _parse_addressed_line(text: str, context: Context) -> tuple[Step, ...]:
    """Return the commands of a line that names controllers, without those for another one."""
    reading, scanner = LineContext(text, context.dialect, context.filling), Scanner(text)
    steps: list[Step] = []
    heard, first = answers(context), _first_of(context)
    while not scanner.at_end:
        if scanner.accept("@"):
            step = AddressCard(read_card(scanner))
            steps.append(step)
            heard = heard if step.number is None else answers(context, step.number)
        elif heard:
            steps += _commands(scanner, reading, first)
        else:
            found = scanner.rest.find("@")
            scanner.reset(scanner.mark() + (len(scanner.rest) if found < 0 else found))
        first = ()
    return tuple(steps)


_Whole = Callable[[Scanner, LineContext], Step | None]
"""Reads a line that is constants only, or returns None."""


def _first_of(context: Context) -> tuple[_Whole, ...]:
    filled = context.controller.tables.is_filled_by(context)
    return (buffer_words.fill_table, _constant) if filled else (_constant,)


def _commands(scanner: Scanner, reading: LineContext, whole: tuple[_Whole, ...]) -> Iterator[Step]:
    """Yield the commands up to the end of the line, or up to the next `@`.

    A word is taken as long as it can be, and what is left of it is no command: the `R` of RESUME runs nothing. So
    letters that follow each other without a space are commands only when all of them report (`#1?PVFM190`).
    """
    step = next((step for read in whole if (step := read(scanner, reading)) is not None), None)
    if step is not None:
        yield step
    quiet = True
    while not scanner.at_end and not scanner.peek("@"):
        joined, begin = scanner.inside_word, scanner.mark()
        step, kind = _command(scanner, reading)
        if joined and kind is not _Kind.TEXT and not (quiet and kind is _Kind.REPORT):
            scanner.reset(begin)
            raise scanner.refusal("no such word")
        quiet = kind is _Kind.REPORT
        yield step


class _Kind(Enum):
    REPORT, ACTION, TEXT = range(3)


def _command(scanner: Scanner, reading: LineContext) -> tuple[Step, _Kind]:
    if reading.fills and not _IMMEDIATE.match(scanner.rest):
        word = _word(scanner, _ALWAYS)
        if word is None:
            return buffers.read_stored(scanner, reading), _Kind.TEXT
    else:
        word = _word(scanner, _ANY)
    if word is not None:
        return _WORDS[word](scanner, reading), _Kind.ACTION
    step = values.variable(scanner, reading)
    if step is not None:
        return step, _Kind.REPORT
    step = systems.set_axis(scanner)
    if step is not None:
        return step, _Kind.ACTION
    letter = scanner.take(_PROGRAM_OR_LETTER)
    if letter is not None:
        if letter not in _LETTERS:
            # Never letter by letter: the R of RAPID or RETURN would run the program, the A of ABS abort it.
            raise PmacError(ErrorCode.NO_BUFFER_OPEN, reading.text[:20])
        return _LETTERS[letter](scanner, reading), _Kind.REPORT if letter in status.LETTERS else _Kind.ACTION
    if buffers.is_program_text(scanner.rest):
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, scanner.rest[:20])
    raise scanner.refusal("no such command")


def _word(scanner: Scanner, words: re.Pattern[str]) -> str | None:
    """Match `RX` only with an address after it: `B1R LIST PC` runs and lists."""
    start = scanner.mark()
    word = scanner.take(words)
    if word in values.WORDS and not scanner.peek(values.ADDRESS_STARTS):
        scanner.reset(start)
        return None
    return word


def _constant(scanner: Scanner, reading: LineContext) -> Step | None:
    """Set P0 from a line that is only a number (User Manual, Special-Use P-Variable)."""
    start = scanner.mark()
    value = None if reading.fills else signed_constant(scanner)
    if value is None or not scanner.at_end:
        scanner.reset(start)
        return None
    return lambda context: context.variables.set(VariableKind.P, 0, value)
