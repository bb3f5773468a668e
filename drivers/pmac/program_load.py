"""Load a program into the controller: sent, read back and compared, with everything sent before it.

The program alone does not determine the motion: its geometry is in the variables and the compensation table that
are sent before it. So those are read back as the lines are. Nothing moves. LinkError is raised when the link
breaks or is out of step, ControllerError when a program does not exist.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import zip_longest

from drivers.controller import REPLY_TIMEOUT_S, Controller
from drivers.errors import ControllerError, DriverError
from drivers.pmac.compensation.table_text import TextTable, definition_text, scan_definition
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import without_end
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.syntax import Program
from drivers.pmac.language.text import format_line
from drivers.pmac.program_constants import (
    AFTER_IT,
    NOT_STARTED,
    Constant,
    constant_problems,
    constants_of,
    pointer_problems,
    read_values,
    word_problems,
)
from drivers.pmac.program_text import ProgramText
from profiles.problem import Problem

SLOWEST_LINE_BYTES_PER_S = 480.0
"""Half of what 9600 baud carry: a listing may take that long, plus `REPLY_TIMEOUT_S`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedProgram:
    """A program that the controller holds, with the constants set before it.

    `copied` are the values of those that are copies of what the controller held when it was loaded.
    """

    program: ProgramText
    dialect: Dialect
    constants: tuple[Constant, ...] = ()
    copied: Mapping[str, float] = field(default_factory=dict)


def load_program(client: Controller, program: ProgramText, dialect: Dialect) -> LoadedProgram:
    """Send a program, read all of it back, and compare.

    On any failure no buffer is left open, or the error says that one may be.

    Raises:
        ControllerError: a line was refused; the error names it, and where it is in the text.
        LinkError: the link broke or is out of step, see `Controller.download`.
        DriverError: `controller.program_differs`, a buffer does not hold what was sent: line, found, sent;
            `controller.constant_differs`, `controller.table_differs`.
    """
    client.request("CLOSE", lines=0)
    _send(client, program)
    constants = constants_of(program, dialect)
    copied = read_values(client, (each.name for each in constants if each.value is None))
    loaded = LoadedProgram(program=program, dialect=dialect, constants=constants, copied=copied)
    _refuse(constant_problems(client, constants))
    _verify(client, loaded, tables=True, words=True)
    return loaded


def _send(client: Controller, program: ProgramText) -> None:
    sent = 0

    def lines() -> Iterator[str]:
        nonlocal sent
        for line in program.lines:
            sent += 1
            yield line

    try:
        client.download(lines())
    except ControllerError as error:
        if not 0 < sent <= len(program.sources):
            raise
        source = Problem(code="program.refused_source", key=program.sources[sent - 1])
        raise ControllerError(*error.problems, source, error_number=error.error_number) from error


def verify_loaded(client: Controller, loaded: LoadedProgram, *, ended: bool = False, tables: bool = True) -> None:
    """Read a program back with everything sent before it, and compare; nothing is written.

    When it has `ended`, the variables that it sets itself are left out. Without `tables` the entries of
    compensation tables are not read: over a slow line that takes seconds.

    Raises DriverError: `controller.program_differs`, `controller.constant_differs` (`cut.constant_changed` of one
    that has ended), `controller.table_differs`.
    """
    constants = tuple(each for each in loaded.constants if each.kept or not ended)
    code = AFTER_IT if ended else NOT_STARTED
    _refuse(constant_problems(client, constants, loaded.copied, code))
    # A time base that was in use has changed its own words of the conversion table.
    _verify(client, loaded, tables=tables, words=not ended, code=code)


def _verify(
    client: Controller, loaded: LoadedProgram, *, tables: bool, words: bool, code: str = NOT_STARTED
) -> None:
    program = loaded.program
    verify_program(client, program)
    _refuse(tuple(pointer_problems(client, program, code)))
    if words:
        _refuse(tuple(word_problems(client, program)))
    for table in program.tables if tables else ():
        _compare_table(client, table, loaded.dialect)


def _refuse(problems: tuple[Problem, ...]) -> None:
    if problems:
        raise DriverError(*problems)


def verify_program(client: Controller, program: ProgramText) -> None:
    """List every motion program of a text and compare; nothing is written.

    Raises DriverError: `controller.program_differs`.
    """
    for number, lines in {program.number: program.program, **program.subprograms}.items():
        _compare(client, number, lines)


def _compare(client: Controller, number: int, lines: Program) -> None:
    target = without_end(format_line(line) for line in lines)
    found = _listing(client, number, target)
    if found != target:
        # The number of lines of a listing is not known before: an extra empty line does not make it differ.
        found = _listing(client, number, target)
    for place, actual, sent in _differences(found, target):
        where, key = f"PROG {number}", f"line {place}"
        raise DriverError(
            Problem(code="controller.program_differs", where=where, key=key, value=actual, limit=sent)
        )


def _differences(found: Iterable[str], target: Iterable[str]) -> Iterator[tuple[int, str, str]]:
    """Yield the places, from 1, at which two listings differ, with both texts."""
    pairs = enumerate(zip_longest(found, target, fillvalue=""), start=1)
    return ((place, actual, sent) for place, (actual, sent) in pairs if actual != sent)


def _listing_timeout_s(target: Iterable[str]) -> float:
    """Return a timeout that grows with the length: a slow line is allowed for, and a broken one still noticed."""
    return REPLY_TIMEOUT_S + sum(len(line) + 1 for line in target) / SLOWEST_LINE_BYTES_PER_S


def _listing(client: Controller, number: int, target: Sequence[str]) -> tuple[str, ...]:
    """List the whole program at once: some controllers count the start of a partial listing in memory words."""
    return tuple(map(_normal_form, without_end(client.question(f"LIST PROG{number}", _listing_timeout_s(target)))))


def _normal_form(line: str) -> str:
    """Return a line as we spell it: a controller may shorten words, or space them otherwise."""
    with suppress(PmacError):
        return format_line(parse_line(line))
    return line


def _compare_table(client: Controller, table: TextTable, dialect: Dialect) -> None:
    """Read a compensation table back: its definition, and each of its entries.

    Raises DriverError: `controller.table_differs`: the first entry that differs, found, sent.
    """
    motor, sent = table.definition.motor, [str(entry) for entry in table.entries]
    where = f"#{motor} COMP"
    (defined,) = client.question(f"#{motor}LIST COMP DEF", lines=1)
    planned = definition_text(table.definition)
    if not _same_definition(defined, planned, motor, dialect.motor_count):
        raise DriverError(
            Problem(code="controller.table_differs", where=where, key="DEFINE COMP", value=defined, limit=planned)
        )
    found = " ".join(client.question(f"#{motor}LIST COMP", _listing_timeout_s(sent))).split()
    for place, actual, entry in _differences(found, sent):
        key = f"entry {place}"
        raise DriverError(
            Problem(code="controller.table_differs", where=where, key=key, value=actual, limit=entry)
        )


def _same_definition(reported: str, planned: str, motor: int, motor_count: int) -> bool:
    """Whether two definitions are equivalent, however they are spelled."""
    if reported.strip() == planned:
        return True
    with suppress(PmacError):
        actual, expected = (
            scan_definition(Scanner(text), motor, motor_count) for text in (reported.strip(), planned)
        )
        return actual == expected
    return False
