"""Loading a program into the card: sent, read back, and compared line by line. Nothing moves."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import zip_longest

from drivers.errors import DriverError
from drivers.pmac.client import REPLY_TIMEOUT_S, PmacClient
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.syntax import Program
from drivers.pmac.language.text import format_line
from drivers.pmac.program_text import ProgramText
from profiles.problem import Problem

SLOWEST_LINE_BYTES_PER_S = 480.0
"""Half of what 9600 baud carry: a listing may take so long, and `REPLY_TIMEOUT_S`."""


def load_program(client: PmacClient, program: ProgramText) -> None:
    """Send a program, list every motion program in it, and compare.

    Whatever goes wrong, no buffer is left open, or the error says that one may be.

    Raises:
        ControllerError: a line was refused; it is named.
        LinkError: the link broke or is out of step, see `PmacClient.download`.
        DriverError: `controller.program_differs`, a buffer does not hold what was sent: line, found, sent.
    """
    client.request("CLOSE", lines=0)
    client.download(program.lines)
    verify_program(client, program)


def verify_program(client: PmacClient, program: ProgramText) -> None:
    """List every motion program of a text and compare; nothing is written.

    Raises:
        LinkError: the link broke or is out of step.
        ControllerError: a program is not there.
        DriverError: `controller.program_differs`.
    """
    for number, lines in {program.number: program.program, **program.subprograms}.items():
        _compare(client, number, lines)


def _compare(client: PmacClient, number: int, lines: Program) -> None:
    wanted = tuple(format_line(line) for line in lines)
    found = _listing(client, number, wanted)
    if found != wanted:
        # Of a listing nobody knows the number of lines before: an empty line that came in is no other program.
        found = _listing(client, number, wanted)
    for place, (met, sent) in enumerate(zip_longest(found, wanted, fillvalue=""), start=1):
        if met != sent:
            raise DriverError(
                Problem(
                    code="controller.program_differs",
                    where=f"PROG {number}",
                    key=f"line {place}",
                    value=met,
                    limit=sent,
                )
            )


def _listing(client: PmacClient, number: int, wanted: Sequence[str]) -> tuple[str, ...]:
    """Ask for all of it at once: where a piece of a listing begins is counted in words of memory on some cards.

    The time allowed follows the length, so that a slow line has it, and one that broke is noticed all the same.
    """
    bytes_expected = sum(len(line) + 1 for line in wanted)
    timeout_s = REPLY_TIMEOUT_S + bytes_expected / SLOWEST_LINE_BYTES_PER_S
    return tuple(_in_our_spelling(line) for line in client.question(f"LIST PROG{number}", timeout_s))


def _in_our_spelling(line: str) -> str:
    """Return a line as we would write it: a card may shorten words, or space them otherwise."""
    with suppress(PmacError):
        return format_line(parse_line(line))
    return line
