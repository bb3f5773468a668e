"""Execute one line of text from a host, command by command.

A line may contain several commands with or without separators; commands before an error stay executed.
"""

from __future__ import annotations

import re
from collections.abc import Generator

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import WORDS as PROGRAM_WORDS
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.card import buffers
from drivers.simulator.commands import addressing, buffer_words, card, jogs, status, systems, values
from drivers.simulator.context import ALL_CARDS, HIGHEST_CARD, Context, signed_constant

_DAISY_CHAIN = 2  # bit 1 of I1: several controllers on one line, addressed with `@n`
_COMMAND_WORK = 5  # cost of any command, in values read or set

_ALWAYS_ON_LINE = addressing.WORDS | buffer_words.WORDS | card.WORDS | status.WORDS | systems.WORDS | values.WORDS
"""Words that are never stored, even while a buffer is open."""

_WORDS = _ALWAYS_ON_LINE | jogs.WORDS | buffer_words.SHARED_WORDS  # with those of programs; the longest wins
_LETTERS = status.LETTERS | jogs.LETTERS | systems.LETTERS  # matched after the variables that begin so
_ALWAYS = tuple(_ALWAYS_ON_LINE)
_ANY = tuple(_WORDS)
_SINGLE = tuple(_LETTERS)

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
    scanner = Scanner(text)
    context.text = text
    whole = scanner.mark()
    while not scanner.at_end:
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
        if not scanner.at_end:
            yield
    return heard


def _command(scanner: Scanner, context: Context, *, first: bool) -> None:
    if first and buffer_words.fill_table(scanner, context):
        return
    if context.fills_buffer and not _IMMEDIATE.match(scanner.rest):
        word = scanner.take_word(_ALWAYS)
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
    if scanner.take_word(PROGRAM_WORDS) is not None:
        # Never letter by letter: the R of RAPID or RETURN would run the program, the A of ABS abort it.
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, context.text[:20])
    letter = scanner.take_word(_SINGLE)
    if letter is not None:
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
    word = scanner.take_word(_ANY)
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
