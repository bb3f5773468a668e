"""Which line of a running program is executed, as the controller reports it. Only queries; nothing moves."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.text import format_line
from drivers.pmac.program_text import ProgramText

EXECUTED = "LIST PE"  # the line that is being executed, after its program and its address

_LISTED = re.compile(r"P(\d+):(\d+)(?::(.*))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramPlace:
    """The line that is executed: its program, its text, and its number in the loaded program, from 1.

    `line` is None where the text occurs several times: the address that the controller reports counts words of its
    memory, not lines. `lines` is how many the program has.
    """

    program: int
    text: str
    line: int | None
    lines: int


def place_of(reply: str, program: ProgramText) -> ProgramPlace | None:
    """Return the place that a reply to `EXECUTED` names; None for one that names no line."""
    found = _LISTED.fullmatch(reply.strip())
    if found is None or not found[3]:
        return None
    number, text = int(found[1]), found[3]
    lines = {program.number: program.program, **program.subprograms}.get(number, ())
    with suppress(PmacError):
        text = format_line(parse_line(text))
    same = [place for place, line in enumerate(lines, start=1) if format_line(line) == text]
    return ProgramPlace(program=number, text=text, line=same[0] if len(same) == 1 else None, lines=len(lines))
