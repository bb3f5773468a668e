"""What a text fills the buffers of a controller with, line by line, and what stands outside of them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum

from drivers.pmac.execution.kinematics import FORWARD, INVERSE, stored_kinematic_line
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import END, stored_line, stored_plc_lines
from drivers.pmac.language.syntax import Line, PlcLine
from drivers.pmac.preprocessor import LineNumber

_ADDRESS = re.compile(r"&\s*(\d+)")
"""A coordinate system is addressed: the next OPEN INVERSE belongs to it."""


class BufferKind(StrEnum):
    """What a buffer holds, as it is called in OPEN and LIST."""

    PROGRAM = "PROG"
    PLC = "PLC"
    INVERSE = INVERSE
    FORWARD = FORWARD

    def buffer_name(self, number: int) -> str:
        """Return how the buffer of a program, PLC or coordinate system is called: `PROG 5`, `&1 INVERSE`."""
        return f"&{number} {self}" if self.of_system else f"{self} {number}"

    def line(self, word: str, number: int) -> str:
        """Return the line that opens or lists it: `OPEN PROG5`, `&1LIST INVERSE`."""
        return f"&{number}{word} {self}" if self.of_system else f"{word} {self}{number}"

    @property
    def of_system(self) -> bool:
        """Whether it belongs to the addressed coordinate system."""
        return self in (BufferKind.INVERSE, BufferKind.FORWARD)


@dataclass(frozen=True, slots=True)
class TextLine:
    """A line without its comment and with its names replaced, and its place in the text."""

    place: LineNumber
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TextBuffer:
    """A buffer that a text opens at `place`; `number` is that of the program, PLC or coordinate system.

    `cleared` is whether it is emptied before its first line, `closed` whether it has its CLOSE.
    """

    kind: BufferKind
    number: int
    place: LineNumber
    lines: tuple[TextLine, ...]
    cleared: bool
    closed: bool

    @property
    def name(self) -> str:
        """Its name: `PROG 5`, `PLC 3`, `&1 INVERSE`."""
        return self.kind.buffer_name(self.number)

    @property
    def opening(self) -> str:
        """The line that opens it."""
        return self.kind.line("OPEN", self.number)

    def listing(self) -> tuple[TextLine, ...]:
        """Return the lines as the controller lists them, each with its place in the text; without the end."""
        found = [TextLine(line.place, text) for line in self.lines for text, _ in store_line(self.kind, line.text)]
        return tuple(found[:-1] if found and found[-1].text == END else found)


def store_line(kind: BufferKind, text: str) -> tuple[tuple[str, Line | PlcLine], ...]:
    """Return the lines that a buffer keeps for a typed one: how each is listed, and what it does.

    Raises PmacError: no buffer of this kind can hold it.
    """
    if kind is BufferKind.PLC:
        return tuple((line.text, line.statements) for line in stored_plc_lines(text))
    line = stored_line(text) if kind is BufferKind.PROGRAM else stored_kinematic_line(text)
    return ((line.text, line.statements),)


def in_full(kind: BufferKind, lines: Iterable[str]) -> tuple[str, ...]:
    """Return lines of a listing in whole words, however I9 and the controller spell them.

    A line that no buffer of this kind could hold stays as it is.
    """
    whole = list[str]()
    for line in lines:
        try:
            whole += [text for text, _ in store_line(kind, line)] or [line]
        except PmacError:
            whole.append(line)
    return tuple(whole)


def same_line(kind: BufferKind, found: str, wanted: str) -> bool:
    """Return whether two lines do the same: one may have shorter words, or other spaces."""
    if found == wanted:
        return True
    with suppress(PmacError):
        first, second = ([does for _, does in store_line(kind, text)] for text in (found, wanted))
        return first == second
    return False


@dataclass(frozen=True, slots=True)
class SourceText:
    """The buffers of a text in its order, and the lines `outside` of them that are no addressing as in `&1`."""

    buffers: tuple[TextBuffer, ...] = ()
    outside: tuple[TextLine, ...] = ()


@dataclass(slots=True)
class BufferLines:
    """Collects them while the text is read. `system` is the addressed coordinate system."""

    system: int = 1
    _buffers: list[TextBuffer] = field(default_factory=list)
    _outside: list[TextLine] = field(default_factory=list)
    _opened: tuple[BufferKind, int, LineNumber] | None = None
    _lines: list[TextLine] = field(default_factory=list)
    _cleared: bool = False

    def open(self, kind: BufferKind, number: int, place: LineNumber) -> None:
        """Begin a buffer."""
        self._opened, self._lines, self._cleared = (kind, number, place), [], False

    def clear(self, place: LineNumber) -> None:
        """Empty the open buffer; without one it is a line outside."""
        if self._opened is None:
            self._outside.append(TextLine(place, "CLEAR"))
            return
        self._lines, self._cleared = [], True

    def close(self, *, closed: bool = True) -> None:
        """End the open buffer, if there is one."""
        if self._opened is None:
            return
        kind, number, place = self._opened
        buffer = TextBuffer(
            kind=kind, number=number, place=place, lines=tuple(self._lines), cleared=self._cleared, closed=closed
        )
        self._buffers.append(buffer)
        self._opened = None

    def take(self, text: str, place: LineNumber) -> None:
        """Take a line of the open buffer, or one outside."""
        if self._opened is not None:
            self._lines.append(TextLine(place, text))
        elif found := _ADDRESS.fullmatch(text):
            self.system = int(found[1])
        else:
            self._outside.append(TextLine(place, text))

    def source_text(self) -> SourceText:
        """Return all of it; a buffer that is still open has no CLOSE."""
        self.close(closed=False)
        return SourceText(tuple(self._buffers), tuple(self._outside))
