"""Send buffers of a file to a controller: what may be sent, what there is before, and what there is after it.

Only whole buffers are sent: OPEN, CLEAR, the lines, CLOSE. Nothing is enabled, run or saved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from drivers.commissioning.check import Check, Group
from drivers.commissioning.comparison import changed_check
from drivers.commissioning.reading import LISTING_TIMEOUT_S, listed_lines, refuse_open_buffer
from drivers.commissioning.restoring import Seen, refuse_busy, send_counted
from drivers.controller import Controller
from drivers.errors import DriverError, RefusedError
from drivers.pmac.buffer_text import BufferKind, TextBuffer, TextLine, same_line
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.listing import END
from drivers.pmac.preprocessor import LineNumber
from profiles.problem import Problem

PERMISSION, FOREGROUND, BACKGROUND = "I5", 1, 2
"""The setting that lets PLCs run; its bits for PLC 0, and for all others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BufferChange:
    """A buffer of the file: `wanted` as the controller lists it, `before` what it lists now (None: not there)."""

    buffer: TextBuffer
    wanted: tuple[TextLine, ...]
    before: tuple[str, ...] | None

    @property
    def differs(self) -> bool:
        """Whether there is anything to send: to the letter, for it costs little to send it."""
        return self.before != tuple(line.text for line in self.wanted)


@dataclass(frozen=True, slots=True)
class SentLine:
    """A line to send; `source` is its place in the file, None for OPEN, CLEAR and CLOSE."""

    text: str
    source: LineNumber | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FailedDownload:
    """What the buffers hold after a sending that has failed, by their names; `asked` is whether they were read."""

    as_file: tuple[str, ...]
    in_part: tuple[str, ...]
    as_before: tuple[str, ...]
    asked: bool


def plan_download(client: Controller, dialect: Dialect, buffers: Iterable[TextBuffer]) -> tuple[BufferChange, ...]:
    """Read what the controller has in the place of these buffers; nothing is written.

    Raises RefusedError: as `refuse_busy`; `controller.entering`; `controller.restore_locked`.
    """
    refuse_busy(client, dialect)
    refuse_open_buffer(client, dialect)
    locked = list[str]()
    found = tuple(
        BufferChange(buffer=each, wanted=each.listing(), before=_read(client, each, locked)) for each in buffers
    )
    if locked:
        where = client.link.address
        raise RefusedError(Problem(code="controller.restore_locked", where=where, value=", ".join(locked)))
    return found


def may_run(client: Controller, changes: Iterable[BufferChange]) -> tuple[str, ...]:
    """Return the PLCs that may be running now: they have text, and I5 lets them run.

    Whether one is enabled cannot be asked.
    """
    plcs = [each for each in changes if each.buffer.kind is BufferKind.PLC and each.before]
    if not plcs:
        return ()
    permitted = int(client.numbers(PERMISSION, again=True)[0])
    return tuple(
        each.buffer.name for each in plcs if permitted & (BACKGROUND if each.buffer.number else FOREGROUND)
    )


def sent_lines(changes: Sequence[BufferChange]) -> tuple[SentLine, ...]:
    """Return the lines of the buffers that differ. PLCs are disabled first: none may run while it is replaced."""
    lines = list[SentLine]()
    plcs = [each.buffer.number for each in changes if each.buffer.kind is BufferKind.PLC and each.differs]
    if plcs:
        lines.append(SentLine(f"DISABLE PLC {','.join(map(str, plcs))}"))
    for change in changes:
        if change.differs:
            lines += _buffer_lines(change.buffer)
    if any(line.text.startswith("&") for line in lines):
        lines.append(SentLine("&1"))
    return tuple(lines)


def _buffer_lines(buffer: TextBuffer) -> list[SentLine]:
    body = [SentLine(sendable(line.text), line.place) for line in buffer.lines]
    return [SentLine(buffer.opening), SentLine("CLEAR"), *body, SentLine("CLOSE")]


def sendable(text: str) -> str:
    """Return a line with blanks in place of tabs outside of quotes: a tab alone is a command (control-I)."""
    pieces = text.split('"')
    pieces[::2] = [piece.replace("\t", " ") for piece in pieces[::2]]
    return '"'.join(pieces)


def send(client: Controller, dialect: Dialect, changes: Sequence[BufferChange], where: str, seen: Seen) -> None:
    """Send what differs, each line once; `where` is the file. Nothing is saved, and no PLC enabled.

    Raises:
        RefusedError: as `refuse_busy`; nothing was sent.
        DriverError: with `download.refused_line` if a line was refused, and with `download.left`: what the
            buffers hold now.
    """
    lines, sent = sent_lines(changes), 0

    def counted(number: int, of: int) -> None:
        nonlocal sent
        sent = number
        seen(number, of)

    refuse_busy(client, dialect)
    try:
        send_counted(client, tuple(line.text for line in lines), counted)
    except DriverError as error:
        source = lines[sent].source if sent < len(lines) else None
        place = () if source is None else (Problem(code="download.line", where=where, key=source.line_name),)
        state = _left_problem(left_after(client, changes, sent), client.link.address)
        raise DriverError(*error.problems, *place, state) from error


def left_after(client: Controller, changes: Sequence[BufferChange], sent: int) -> FailedDownload:
    """Return what the buffers hold after `sent` lines were acknowledged: as read, or as far as that is known."""
    judge: Callable[[BufferChange, int], str]
    try:
        found = {each.buffer.name: _read(client, each.buffer, []) for each in changes}
    except DriverError:
        asked, judge = False, _by_count
    else:
        asked, judge = True, lambda change, done: _by_listing(change, found[change.buffer.name])
    kinds: dict[str, list[str]] = {"as_file": [], "in_part": [], "as_before": []}
    ends = 1 if any(each.differs and each.buffer.kind is BufferKind.PLC for each in changes) else 0
    for change in changes:
        kinds[judge(change, sent - ends)].append(change.buffer.name)
        ends += len(change.buffer.lines) + 3 if change.differs else 0
    return FailedDownload(asked=asked, **{kind: tuple(names) for kind, names in kinds.items()})


def _by_listing(change: BufferChange, found: tuple[str, ...] | None) -> str:
    if _first_difference(change, found) is None:
        return "as_file"
    return "as_before" if found == change.before else "in_part"


def _by_count(change: BufferChange, done: int) -> str:
    """Judge by the acknowledged lines of a buffer: OPEN changes no line, CLEAR may have been carried out."""
    if not change.differs or done >= len(change.buffer.lines) + 3:
        return "as_file"
    return "in_part" if done > 0 else "as_before"


def _left_problem(left: FailedDownload, where: str) -> Problem:
    code = "download.left" if left.asked else "download.left_unread"
    file, part, before = (", ".join(names) or "-" for names in (left.as_file, left.in_part, left.as_before))
    return Problem(code=code, where=where, key=part, value=file, limit=before)


def differing(client: Controller, changes: Iterable[BufferChange]) -> list[Check]:
    """List each buffer again, and return the first line of each that is not as in the file."""
    checks = list[Check]()
    for change in changes:
        found = _read(client, change.buffer, [])
        if _first_difference(change, found) is not None:
            found = _read(client, change.buffer, [])  # the number of lines of a listing is not known before
        difference = _first_difference(change, found)
        if difference is not None:
            line, actual, wanted = difference
            checks.append(changed_check(Group.PROGRAMS, f"{change.buffer.name}:{line}", actual, wanted))
    return checks


def _first_difference(change: BufferChange, found: Sequence[str] | None) -> tuple[int, str, str] | None:
    """Return the first line, from 1, that differs, with what was found and what is wanted."""
    wanted = [line.text for line in change.wanted]
    if found is None:
        return 1, "-", wanted[0] if wanted else END
    for number, (actual, text) in enumerate(zip_longest(found, wanted), start=1):
        if actual is None or text is None or not same_line(change.buffer.kind, actual, text):
            return number, "-" if actual is None else actual, "-" if text is None else text
    return None


def _read(client: Controller, buffer: TextBuffer, locked: list[str]) -> tuple[str, ...] | None:
    lines = listed_lines(client, buffer.kind, buffer.number, LISTING_TIMEOUT_S, locked)
    if buffer.kind.of_system:
        client.request("&1", lines=0)
    return lines
