"""What a file must not have to be sent to a controller; decided before anything is sent."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress

from drivers.commissioning.downloading import sendable
from drivers.pmac.buffer_text import BufferKind, SourceText, TextBuffer, store_line
from drivers.pmac.client import LINE_LIMIT
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.heartbeat.watchdog import RUNNING, TOOL_HOMED, wait_timer, watchdog_timer
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.listing import stored_line, stored_plc_lines
from drivers.pmac.language.plc_statements import link_plc
from drivers.pmac.language.structure import link
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import END_FLAG, OWN_VARIABLES, PLCS, PROGRAMS, WITNESS_POINTERS
from profiles.files import printable
from profiles.problem import Problem

SHOWN = 60  # characters of a line that a sentence names
_NUMBER = r"\$[0-9A-F]+|\d+|\([^()]*\)"
_WRITTEN = re.compile(
    rf"(?<![A-Z])([PMI])\s*({_NUMBER})\s*(?:\.\.\s*({_NUMBER})|,\s*({_NUMBER})(?:\s*,\s*({_NUMBER}))?)?\s*=(?!=)",
    re.IGNORECASE,
)
"""`P5=`, `P(5)=`, `P5..9=`, `P5,3,2=` in an on-line command: one, a range, or so many that are so far apart."""


class OwnVariables:
    """What belongs to the console in a controller of one family: P971 to P1023, M-variables and two timers."""

    def __init__(self, dialect: Dialect) -> None:
        own = {
            "P": set(OWN_VARIABLES),
            "M": {END_FLAG, *range(RUNNING, TOOL_HOMED + 1), *WITNESS_POINTERS},
            "I": set[int](),
        }
        for timer in (watchdog_timer(dialect), wait_timer(dialect)):
            own[timer.name[0]].add(int(timer.name[1:]))
        self._own: Mapping[str, set[int]] = own

    def find_written(self, kind: BufferKind, text: str) -> tuple[str, ...]:
        """Return those that a line of a buffer writes, by names such as `P1000`; none of a bad line."""
        found = set[tuple[str, int]]()
        with suppress(PmacError):
            for _, statements in store_line(kind, text):
                for statement in statements:
                    found.update(self._find_written(statement))
        return tuple(f"{letter}{number}" for letter, number in sorted(found) if number in self._own[letter])

    def _find_written(self, statement: syntax.Statement | syntax.PlcStatement) -> Iterator[tuple[str, int]]:
        if isinstance(statement, syntax.Assign) and statement.target.kind.value in self._own:
            with suppress(_ComputedError, PmacError):
                yield statement.target.kind.value, int(evaluate(statement.target.index, _UnknownItem()))
        elif isinstance(statement, syntax.Message) and statement.word == "CMD":
            for written in _WRITTEN.finditer(statement.text):
                with suppress(_ComputedError, PmacError):
                    yield from self._in_command(written)

    def _in_command(self, written: re.Match[str]) -> Iterator[tuple[str, int]]:
        letter, (first, last, count, step) = written[1].upper(), map(_number, written.groups()[1:])
        assert first is not None
        most = max(self._own[letter], default=0)  # what is beyond is not asked for, however long a range is
        if last is not None:
            numbers = range(first, min(last, most) + 1)
        elif count is None:
            numbers = range(first, first + 1)
        else:
            each = max(1 if step is None else step, 1)
            numbers = range(first, min(first + count * each, most + 1), each)
        for number in numbers:
            yield letter, number


def _number(text: str | None) -> int | None:
    """Return a number of an on-line command, read as a program reads that of a variable."""
    if text is None:
        return None
    ((_, (statement,)),) = store_line(BufferKind.PROGRAM, f"P({text.strip('()')})=0")
    assert isinstance(statement, syntax.Assign)
    return int(evaluate(statement.target.index, _UnknownItem()))


class _ComputedError(Exception):
    """A number that depends on a variable."""


class _UnknownItem:
    def get(self, kind: VariableKind, index: int) -> float:
        raise _ComputedError


def refusals(source: SourceText, where: str, family: str) -> tuple[Problem, ...]:
    """Return why the buffers of a text `where` are not sent to a controller of this family, each with its line."""
    if not source.buffers and not source.outside:
        return (Problem(code="download.nothing", where=where),)
    outside = (
        Problem(code="download.outside", where=where, key=line.place.line_name, value=printable(line.text, SHOWN))
        for line in source.outside
    )
    return (*outside, *_of_buffers(source.buffers, where, OwnVariables(DIALECTS[family])))


def _of_buffers(buffers: Iterable[TextBuffer], where: str, own: OwnVariables) -> Iterator[Problem]:
    seen = set[str]()
    for buffer in buffers:
        code = _opened_wrongly(buffer, seen)
        if code is not None:
            yield Problem(code=code, where=where, key=buffer.place.line_name, value=buffer.name)
        seen.add(buffer.name)
        yield from _unsendable(buffer, where)
        for line in buffer.lines:
            if written := own.find_written(buffer.kind, line.text):
                key, value = line.place.line_name, ", ".join(written)
                yield Problem(code="download.own_variables", where=where, key=key, value=value)


def _opened_wrongly(buffer: TextBuffer, seen: set[str]) -> str | None:
    programs = PROGRAMS if buffer.kind is BufferKind.PROGRAM else frozenset[int]()
    if buffer.number in programs or (buffer.kind is BufferKind.PLC and buffer.number in PLCS):
        return "download.reserved"
    if buffer.name in seen:
        return "download.twice"
    if not buffer.cleared:
        return "download.no_clear"
    return None if buffer.closed else "download.no_close"


def _unsendable(buffer: TextBuffer, where: str) -> Iterator[Problem]:
    """Yield lines too long, or with characters that no buffer takes: some of those are commands at once."""
    for line in buffer.lines:
        text = sendable(line.text)
        code = None
        if len(text) > LINE_LIMIT:
            code = "download.too_long"
        elif not all(" " <= character <= "~" for character in text):
            code = "download.characters"
        if code is not None:
            value = printable(line.text, SHOWN)
            yield Problem(code=code, where=where, key=line.place.line_name, value=value, limit=str(LINE_LIMIT))


def badly_formed(buffers: Iterable[TextBuffer], where: str) -> Iterator[Problem]:
    """Yield each buffer with a loop or branch that the controller would refuse to run.

    The lines of the buffers were read without refusal.
    """
    for buffer in buffers:
        try:
            _link(buffer)
        except PmacError as error:
            key = buffer.place.line_name
            yield Problem(code="download.structure", where=where, key=key, value=buffer.name, limit=str(error))


def _link(buffer: TextBuffer) -> None:
    if buffer.kind is BufferKind.PLC:
        link_plc(tuple(kept.statements for line in buffer.lines for kept in stored_plc_lines(line.text)))
    else:
        link(tuple(stored_line(line.text).statements for line in buffer.lines))
