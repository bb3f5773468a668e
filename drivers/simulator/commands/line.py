"""Execute one line of text from a host, command by command.

A line may contain several commands with or without separators; commands before an error stay executed.
"""

from __future__ import annotations

import re
from collections.abc import Generator

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner, longest_of
from drivers.pmac.language.parser import WORDS as PROGRAM_WORDS
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.card import buffers
from drivers.simulator.commands import addressing, buffer_words, card, jogs, status, systems, values
from drivers.simulator.commands.polls import Step, compiled
from drivers.simulator.context import ALL_CARDS, HIGHEST_CARD, Context, signed_constant

_DAISY_CHAIN = 2  # bit 1 of I1: several controllers on one line, addressed with `@n`
_COMMAND_WORK = 5  # cost of any command, in values read or set

_ALWAYS_ON_LINE = addressing.WORDS | buffer_words.WORDS | card.WORDS | status.WORDS | systems.WORDS | values.WORDS
"""Words that are never stored, even while a buffer is open."""

_WORDS = _ALWAYS_ON_LINE | jogs.WORDS | buffer_words.SHARED_WORDS  # with those of programs; the longest wins
_LETTERS = status.LETTERS | jogs.LETTERS | systems.LETTERS  # matched after the variables that begin so
_ALWAYS = longest_of(tuple(_ALWAYS_ON_LINE))
_ANY = longest_of(tuple(_WORDS))
_PROGRAM_OR_LETTER = longest_of((*PROGRAM_WORDS, *_LETTERS))

_IMMEDIATE = re.compile(r"J(?:[+/=:^]|-(?![\d.($]))|[PVFKRSHQAZ]+(?=[#&?%@]|$)|M\d+(?:\.\.\d+)?->")
"""Commands although their letters are program words: `J+` is a jog, `J-5` is part of the centre of a circle."""


def answers(context: Context) -> bool:
    """Whether this host has addressed the controller; alone on its line, it always has."""
    variables = context.controller.variables
    if not int(variables.i(1)) & _DAISY_CHAIN:
        return True
    return context.card_number in (ALL_CARDS, int(variables.i(0)) & HIGHEST_CARD)


def commands(text: str, context: Context) -> Generator[None, None, bool]:
    """Execute one line, yielding between two commands; the caller may do something else there.

    Data for the host is appended to `context.lines`, the cost of the commands is added to `context.work`.

    Returns:
        Whether the line, or a part of it, was for this controller.

    Raises PmacError: the command at which execution stopped.
    """
    heard = answers(context)
    if not heard and "@" not in text:
        return False
    if not context.fills_buffer and not context.controller.tables.is_filled_by(context):
        steps = compiled(text, _word, _PROGRAM_OR_LETTER) if heard else None
        if steps is not None:
            context.text = text
            return (yield from _execute(steps, context))
    scanner = Scanner(text)
    context.text = text
    whole = scanner.mark()
    ended = scanner.at_end
    while not ended:
        if scanner.accept("@"):
            addressing.address_card(scanner, context)
        elif answers(context):
            _command(scanner, context, first=scanner.mark() == whole)
        else:
            # Commands for another controller.
            found = scanner.rest.find("@")
            scanner.reset(scanner.mark() + (len(scanner.rest) if found < 0 else found))
        heard = heard or answers(context)
        context.work += _COMMAND_WORK
        ended = scanner.at_end
        if not ended:
            yield
    return heard


def _execute(steps: tuple[Step, ...], context: Context) -> Generator[None, None, bool]:
    """Execute a line that was read before; it names no controller."""
    variables, last = context.controller.variables, len(steps)
    revision = variables.i_revision
    for number, step in enumerate(steps, 1):
        # Another host may have changed how controllers are addressed: the rest is not for this one then.
        heard = variables.i_revision == revision or answers(context)
        if heard:
            step(context)
        context.work += _COMMAND_WORK
        if not heard or number == last:
            break
        yield
    return True


def _command(scanner: Scanner, context: Context, *, first: bool) -> None:
    if first and buffer_words.fill_table(scanner, context):
        return
    if context.fills_buffer and not _IMMEDIATE.match(scanner.rest):
        word = scanner.take(_ALWAYS)
        if word is None:
            buffers.store(scanner, context)
            return
    else:
        word = _word(scanner)
    if word is not None:
        _WORDS[word](scanner, context)
        return
    if values.variable(scanner, context) or systems.set_axis(scanner, context):
        return
    letter = scanner.take(_PROGRAM_OR_LETTER)
    if letter is not None:
        if letter not in _LETTERS:
            # Never letter by letter: the R of RAPID or RETURN would run the program, the A of ABS abort it.
            raise PmacError(ErrorCode.NO_BUFFER_OPEN, context.text[:20])
        _LETTERS[letter](scanner, context)
        return
    if first and _constant(scanner, context):
        return
    if buffers.is_program_text(scanner.rest):
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, scanner.rest[:20])
    raise scanner.refusal("no such command")


def _word(scanner: Scanner) -> str | None:
    """Match `RX` only with an address after it: `B1R LIST PC` runs and lists."""
    start = scanner.mark()
    word = scanner.take(_ANY)
    if word in values.WORDS and not scanner.peek(values.ADDRESS_STARTS):
        scanner.reset(start)
        return None
    return word


def _constant(scanner: Scanner, context: Context) -> bool:
    """Set P0 from a line that is only a number (User Manual, Special-Use P-Variable)."""
    start = scanner.mark()
    value = signed_constant(scanner)
    if value is None or not scanner.at_end:
        scanner.reset(start)
        return False
    context.variables.set(VariableKind.P, 0, value)
    return True
