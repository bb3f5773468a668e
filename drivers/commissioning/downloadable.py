"""What a file must not have to be sent to a controller; decided before anything is sent."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from drivers.commissioning.downloading import sendable
from drivers.commissioning.own_variables import OwnVariables
from drivers.pmac.buffer_text import BufferKind, SourceText, TextBuffer
from drivers.pmac.client import LINE_LIMIT
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import stored_line, stored_plc_lines
from drivers.pmac.language.plc_statements import link_plc
from drivers.pmac.language.structure import link
from drivers.pmac.reserved import HEARTBEAT_PLC, PROGRAMS
from profiles.files import printable
from profiles.problem import Problem

SHOWN = 60  # characters of a line that a sentence names


def refusals(source: SourceText, where: str, family: str) -> tuple[Problem, ...]:
    """Return why the buffers of a text `where` are not sent to a controller of this family, each with its line."""
    if not source.buffers and not source.outside:
        return (Problem(code="download.nothing", where=where),)
    outside = (
        Problem(code="download.outside", where=where, key=line.place.named, value=printable(line.text, SHOWN))
        for line in source.outside
    )
    return (*outside, *_of_buffers(source.buffers, where, OwnVariables(DIALECTS[family])))


def _of_buffers(buffers: Iterable[TextBuffer], where: str, own: OwnVariables) -> Iterator[Problem]:
    seen = set[str]()
    for buffer in buffers:
        code = _opened_wrongly(buffer, seen)
        if code is not None:
            yield Problem(code=code, where=where, key=buffer.place.named, value=buffer.name)
        seen.add(buffer.name)
        yield from _unsendable(buffer, where)
        for line in buffer.lines:
            if written := own.written(buffer.kind, line.text):
                key, value = line.place.named, ", ".join(written)
                yield Problem(code="download.own_variables", where=where, key=key, value=value)


def _opened_wrongly(buffer: TextBuffer, seen: set[str]) -> str | None:
    programs = PROGRAMS if buffer.kind is BufferKind.PROGRAM else frozenset[int]()
    if buffer.number in programs or (buffer.kind is BufferKind.PLC and buffer.number == HEARTBEAT_PLC):
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
            yield Problem(code=code, where=where, key=line.place.named, value=value, limit=str(LINE_LIMIT))


def badly_formed(buffers: Iterable[TextBuffer], where: str) -> Iterator[Problem]:
    """Yield each buffer with a loop or branch that the controller would refuse to run.

    The lines of the buffers were read without refusal.
    """
    for buffer in buffers:
        try:
            _link(buffer)
        except PmacError as error:
            key = buffer.place.named
            yield Problem(code="download.structure", where=where, key=key, value=buffer.name, limit=str(error))


def _link(buffer: TextBuffer) -> None:
    if buffer.kind is BufferKind.PLC:
        link_plc(tuple(kept.statements for line in buffer.lines for kept in stored_plc_lines(line.text)))
    else:
        link(tuple(stored_line(line.text).statements for line in buffer.lines))
