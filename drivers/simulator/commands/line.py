"""One line of text from a host, executed command by command.

Several commands may stand in a line with or without separators; what was done before an error stays done.
"""

from __future__ import annotations

import re
from collections.abc import Generator

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import WORDS as PROGRAM_WORDS
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.card import buffers
from drivers.simulator.commands import (
    addressing,
    buffer_words,
    card,
    gather_words,
    identity,
    jogs,
    memory,
    status,
    systems,
    table_words,
    values,
)
from drivers.simulator.commands.handler import Handler
from drivers.simulator.context import ALL_CARDS, HIGHEST_CARD, Context

_DAISY_CHAIN = 2
"""Bit 1 of I1: cards on one line, addressed with `@n`."""

_COMMAND_WORK = 5
"""What any command costs, in values that are read or set."""

_ALWAYS_ON_LINE: dict[str, Handler] = {
    **addressing.WORDS,
    **buffer_words.WORDS,
    **card.WORDS,
    **gather_words.WORDS,
    **identity.WORDS,
    **memory.WORDS,
    **status.WORDS,
    **systems.WORDS,
    **table_words.WORDS,
}
"""Words that are never stored, not even while a buffer is open."""

_WORDS: dict[str, Handler] = {**_ALWAYS_ON_LINE, **jogs.WORDS, **buffer_words.SHARED_WORDS}
"""With those that may also be words of a program; the longest that fits wins."""

_LETTERS: dict[str, Handler] = {**status.LETTERS, **jogs.LETTERS, **systems.LETTERS}
"""Single letters, looked for after the variables that begin with the same letter."""

_ALWAYS = tuple(_ALWAYS_ON_LINE)
_ANY = tuple(_WORDS)
_SINGLE = tuple(_LETTERS)

_IMMEDIATE = re.compile(r"J(?:[+/=:^]|-(?![\d.($]))|[PVFKRSHQAZ]+(?=[#&?%@]|$)|M\d+(?:\.\.\d+)?->")
"""What cannot be a program's although its letters can: `J+` is a jog, `J-5` is part of the centre of a circle."""


def answers(context: Context) -> bool:
    """Whether the card is the one that this host has addressed; alone on its line, it always is."""
    variables = context.controller.variables
    if not int(variables.i(1)) & _DAISY_CHAIN:
        return True
    return context.card_number in (ALL_CARDS, int(variables.i(0)) & HIGHEST_CARD)


def execute(text: str, context: Context) -> bool:
    """Execute one line in one go.

    Returns:
        Whether the line, or a part of it, was for this card.

    Raises:
        PmacError: the command at which execution stopped.
    """
    running = commands(text, context)
    while True:
        try:
            next(running)
        except StopIteration as done:
            return bool(done.value)


def commands(text: str, context: Context) -> Generator[None, None, bool]:
    """Execute one line, with a pause between two commands; whoever runs it may do something else there.

    Data for the host is appended to `context.lines`, what the commands cost is added to `context.work`.

    Returns:
        Whether the line, or a part of it, was for this card.

    Raises:
        PmacError: the command at which execution stopped.
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
            _pass_over(scanner)
        heard = heard or answers(context)
        context.work += _COMMAND_WORK
        if not scanner.at_end:
            yield
    return heard


def _command(scanner: Scanner, context: Context, *, first: bool) -> None:
    if first and table_words.fill(scanner, context):
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
    if not (first and _constant(scanner, context)):
        raise _refusal(scanner)


def _word(scanner: Scanner) -> str | None:
    """`RX` is only a word with an address behind it: `B1R LIST PC` runs and lists."""
    start = scanner.mark()
    word = scanner.take_word(_ANY)
    if word in memory.WORDS and not scanner.peek(memory.ADDRESS_STARTS):
        scanner.reset(start)
        return None
    return word


def _constant(scanner: Scanner, context: Context) -> bool:
    """A line that is nothing but a number sets P0 (User Manual, Special-Use P-Variable)."""
    start = scanner.mark()
    negative = scanner.accept("-")
    value = scanner.take_number()
    if value is None or not scanner.at_end:
        scanner.reset(start)
        return False
    context.variables.set(VariableKind.P, 0, -value if negative else value)
    return True


def _refusal(scanner: Scanner) -> PmacError:
    if buffers.is_program_text(scanner.rest):
        return PmacError(ErrorCode.NO_BUFFER_OPEN, scanner.rest[:20])
    return scanner.refusal("no such command")


def _pass_over(scanner: Scanner) -> None:
    """What another card is told is nothing to this one."""
    rest = scanner.rest
    found = rest.find("@")
    scanner.reset(scanner.mark() + (len(rest) if found < 0 else found))
