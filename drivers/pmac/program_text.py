"""A program as it is sent: settings, then OPEN PROG n, CLEAR, the lines, CLOSE; comments stay on the host."""

from __future__ import annotations

import re
from dataclasses import dataclass

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.syntax import Line, Program

_OPEN = re.compile(r"OPEN\s*PROG\s*(\d+)$", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramText:
    """`settings` are executed on line before; `program` is what the buffer `number` is to hold.

    `lines` are the texts to send, without comments and empty lines, in order.
    """

    number: int
    settings: tuple[Line, ...]
    program: Program
    lines: tuple[str, ...]


def read_program(text: str) -> ProgramText:
    """Take a text apart as the card would.

    Raises:
        PmacError: the line that is wrong is in its detail.
    """
    number = 0
    settings: list[Line] = []
    program: list[Line] = []
    sent: list[str] = []
    opened = False
    for place, raw in enumerate(text.splitlines(), start=1):
        line = raw.partition(";")[0].strip()
        if not line:
            continue
        sent.append(line)
        match = _OPEN.fullmatch(line)
        if match:
            number, opened = int(match[1]), True
        elif line.upper() == "CLEAR":
            program.clear()
        elif line.upper() == "CLOSE":
            opened = False
        else:
            (program if opened else settings).append(_parsed(line, place))
    if not number:
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, "no OPEN PROG in the text")
    return ProgramText(number=number, settings=tuple(settings), program=tuple(program), lines=tuple(sent))


def _parsed(line: str, place: int) -> Line:
    try:
        return parse_line(line)
    except PmacError as error:
        raise PmacError(error.code, f"line {place}: {error.detail}") from error
