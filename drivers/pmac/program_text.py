"""A program as it is sent: settings, tables, then OPEN PROG n, CLEAR, the lines, CLOSE; no comments are sent."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from drivers.pmac.axes import AxisDefinition, scan_definition
from drivers.pmac.buffer_text import BufferKind, BufferLines, SourceText
from drivers.pmac.compensation.table_text import MOST_MOTORS, CompensationTableReader, TextTable
from drivers.pmac.execution.calls import FIRST_CODE_PROGRAM
from drivers.pmac.execution.kinematics import KINDS, stored_kinematic_line
from drivers.pmac.language import syntax
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import (
    CLEAR,
    CLOSE,
    HIGHEST_PLC,
    HIGHEST_PROGRAM,
    OPEN_PLC,
    OPEN_PROGRAM,
    TRAILING_CLOSE,
    parse_number,
)
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import stored_plc_lines
from drivers.pmac.language.parser import parse_line, parse_statement
from drivers.pmac.language.structure import ExecutableProgram, link
from drivers.pmac.language.syntax import Line, Program
from drivers.pmac.preprocessor import Include, LineNumber, preprocess

_OPEN_KINEMATIC = {f"OPEN{word}": kind for word, kind in KINDS.items()}
_BUFFER_WORDS = (*OPEN_PROGRAM, *OPEN_PLC, *_OPEN_KINEMATIC, "OPEN", *CLEAR, *CLOSE)

_BUFFERED = (
    syntax.Set
    | syntax.SelectMode
    | syntax.Wait
    | syntax.Preset
    | syntax.While
    | syntax.If
    | syntax.Else
    | syntax.EndWhile
    | syntax.EndIf
    | syntax.Goto
    | syntax.Gosub
    | syntax.Read
    | syntax.Return
)
OnLine = Callable[[str], None]
"""Reads a line of on-line commands. Raises PmacError: the controller does not understand it."""

_UNDEFINE = re.compile(r"UNDEF(INE)?\s*(ALL)?", re.IGNORECASE)
_ON_LINE_LETTERS = ("B", "I")
"""B1 and I100 are commands, too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramText:
    """`settings` are executed on-line first; `program` is the content of buffer `number`.

    `lines` are the texts to send, without comments and empty lines, in order. Of several programs in a text the
    first one that is not reserved for G, M, T and D codes (below 1000) is the program, the others are
    `subprograms`. `definitions` are axis definitions, `plcs` the lines between OPEN PLC and CLOSE, and `commands`
    the other on-line commands, both as they are in the text. `tables` are the compensation tables that the
    controller then holds. `kinematics` are the programs INVERSE and FORWARD. `places` are the line numbers (from
    1) of each program's lines in the text, `setting_places` those of the settings; both are a `LineNumber`.
    `sources` name the place of each of `lines`, such as `12`, or `12, limits.h:5` for one of an included file.
    `undefines` is whether it clears the axis definitions that there are before. `source` is what the text fills
    buffers with, line by line, and what it has outside of them.
    """

    number: int
    settings: tuple[Line, ...]
    program: Program
    lines: tuple[str, ...]
    subprograms: Mapping[int, Program] = field(default_factory=dict)
    definitions: tuple[AxisDefinition, ...] = ()
    commands: tuple[str, ...] = ()
    plcs: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    places: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    tables: tuple[TextTable, ...] = ()
    setting_places: tuple[int, ...] = ()
    kinematics: Mapping[str, tuple[Line, ...]] = field(default_factory=dict)
    sources: tuple[str, ...] = ()
    undefines: bool = False
    source: SourceText = field(default_factory=SourceText)

    def code(self, number: int) -> ExecutableProgram | None:
        """Return a program of this text ready to run: the library of its calls.

        Raises PmacError: 009 or 016, a program that is not well formed.
        """
        program = self.program if number == self.number else self.subprograms.get(number)
        return None if program is None else link(program)


@dataclass(frozen=True, slots=True, kw_only=True)
class RefusedLine:
    """A line of a text, or of a file that it includes, that the controller refuses."""

    place: LineNumber
    text: str
    error: PmacError

    @property
    def where(self) -> str:
        """Its line in the text, and in the included file."""
        return self.place.line_name


def read_program(
    text: str,
    refused: list[RefusedLine] | None = None,
    motor_count: int = MOST_MOTORS,
    include: Include | None = None,
    *,
    kinematic: bool = True,
    on_line: OnLine = lambda line: None,
    needs_program: bool = True,
) -> ProgramText:
    """Parse a text as a controller with this many motors would, with its #define, #ifdef and #include carried out.

    `kinematic` is whether the controller has kinematic programs. `include` returns the text of another file;
    without it none can be included.

    `on_line` reads each line outside of the buffers as the controller does; without it words of commands that are
    no settings are not looked at.

    With `refused`, the lines that the controller refuses are collected there and reading continues, as on the
    controller. A text that `needs_program` has an OPEN PROG; else it may have PLCs or kinematic programs alone.

    Raises PmacError: its detail names the wrong line.
    """
    taken = _TextContent(tables=CompensationTableReader(motor_count), kinematic=kinematic, on_line=on_line)
    for source in preprocess(text, include):
        taken.place = source.place
        try:
            if source.error is not None:
                raise source.error
            taken.lines.append(source.text)
            taken.sources.append(taken.place.line_name)
            taken.take(source.text)
        except PmacError as error:
            line = RefusedLine(place=taken.place, text=source.text, error=error)
            if refused is None:
                raise PmacError(error.code, f"line {line.where}: {error.detail}") from error
            refused.append(line)
    if needs_program and not taken.programs:
        raise _without_program(refused)
    return taken.to_program_text()


def _without_program(refused: Sequence[RefusedLine] | None) -> PmacError:
    """Return the error of a text without a program; the first refused line is usually why."""
    missing = "no OPEN PROG in the text"
    if not refused:
        return PmacError(ErrorCode.NO_BUFFER_OPEN, missing)
    first = refused[0]
    return PmacError(first.error.code, f"line {first.where}: {first.error.detail}; {missing}")


@dataclass(slots=True)
class _TextContent:
    """What has been read so far; `program` or `plc` is the open buffer."""

    tables: CompensationTableReader
    lines: list[str] = field(default_factory=list)
    sources: list[str] = field(default_factory=list)
    settings: list[Line] = field(default_factory=list)
    setting_places: list[int] = field(default_factory=list)
    definitions: dict[int, AxisDefinition] = field(default_factory=dict)
    commands: list[str] = field(default_factory=list)
    programs: dict[int, list[Line]] = field(default_factory=dict)
    plcs: dict[int, list[str]] = field(default_factory=dict)
    places: dict[int, list[int]] = field(default_factory=dict)
    place: LineNumber = field(default_factory=lambda: LineNumber(0))
    number: int = 0
    program: list[Line] | None = None
    plc: list[str] | None = None
    undefines: bool = False
    kinematic: bool = True
    on_line: OnLine = lambda line: None
    kinematics: dict[str, list[Line]] = field(default_factory=dict)
    calculation: list[Line] | None = None
    buffers: BufferLines = field(default_factory=BufferLines)

    def to_program_text(self) -> ProgramText:
        number = next((n for n in self.programs if n < FIRST_CODE_PROGRAM), next(iter(self.programs), 0))
        return ProgramText(
            number=number,
            settings=tuple(self.settings),
            program=tuple(self.programs.get(number, ())),
            lines=tuple(self.lines),
            sources=tuple(self.sources),
            undefines=self.undefines,
            subprograms={n: tuple(lines) for n, lines in self.programs.items() if n != number},
            definitions=tuple(self.definitions.values()),
            commands=tuple(self.commands),
            plcs={n: tuple(lines) for n, lines in self.plcs.items()},
            places={n: tuple(places) for n, places in self.places.items()},
            tables=self.tables.tables,
            setting_places=tuple(self.setting_places),
            kinematics={kind: tuple(lines) for kind, lines in self.kinematics.items()},
            source=self.buffers.source_text(),
        )

    def take(self, line: str) -> None:
        scanner = Scanner(line)
        while (word := scanner.take_word(_BUFFER_WORDS) or self._opening_after_system(scanner)) is not None:
            self._buffer_word(scanner, word)
        rest = line[scanner.position :]
        closing = TRAILING_CLOSE.search(rest)
        if closing is not None:
            rest = rest[: closing.start()]
        self._line(rest.strip())
        if closing is not None:
            self._close()

    def _opening_after_system(self, scanner: Scanner) -> str | None:
        """Take `&1` and the word behind it, where that is one of a buffer, as in `&1OPEN INVERSE`."""
        mark = scanner.mark()
        if scanner.accept("&") and (system := scanner.take_integer()) is not None:
            word = scanner.take_word(_BUFFER_WORDS)
            if word is not None:
                self.commands.append(f"&{system}")
                self.buffers.system = system
                return word
        scanner.reset(mark)
        return None

    def _close(self) -> None:
        self.program = self.plc = self.calculation = None
        self.buffers.close()

    def _buffer_word(self, scanner: Scanner, word: str) -> None:
        if word in CLOSE:
            scanner.accept("ALL")
            self._close()
        elif word in CLEAR:
            self.buffers.clear(self.place)
            for buffer in (self.program, self.plc, self.calculation):
                if buffer is not None:
                    buffer.clear()
            if self.program is not None:
                self.places[self.number] = []
        elif self.program is not None or self.plc is not None or self.calculation is not None:
            raise PmacError(ErrorCode.BUFFER_IN_USE, "CLOSE is missing before the next OPEN")
        elif word in OPEN_PLC:
            number = parse_number(scanner, 0, HIGHEST_PLC)
            self.plc = self.plcs.setdefault(number, [])
            self.buffers.open(BufferKind.PLC, number, self.place)
        elif word in _OPEN_KINEMATIC:
            self._refuse_without(word)
            self.calculation = self.kinematics.setdefault(_OPEN_KINEMATIC[word], [])
            self.buffers.open(BufferKind(_OPEN_KINEMATIC[word]), self.buffers.system, self.place)
        elif word in OPEN_PROGRAM:
            self.number = parse_number(scanner, 1, HIGHEST_PROGRAM)
            self.program = self.programs.setdefault(self.number, [])
            self.places.setdefault(self.number, [])
            self.buffers.open(BufferKind.PROGRAM, self.number, self.place)
        else:
            raise scanner.refusal("OPEN PROG or OPEN PLC")

    def _refuse_without(self, what: str) -> None:
        if not self.kinematic:
            raise PmacError(ErrorCode.DATA_ERROR, f"{what}: this family has no inverse kinematics")

    def _line(self, text: str) -> None:
        if not text:
            return
        self.buffers.take(text, self.place)
        if self.program is not None:
            self.program.append(parse_line(text))
            self.places[self.number].append(self.place)
        elif self.plc is not None:
            stored_plc_lines(text)  # refuses what no PLC can hold
            self.plc.append(text)
        elif self.calculation is not None:
            self.calculation.append(stored_kinematic_line(text).statements)
        else:
            self._on_line(text)

    def _on_line(self, text: str) -> None:
        """Extract assignments, axis definitions and tables from a line; the commands between them stay text."""
        scanner = Scanner(text)
        if self.tables.take_entries(scanner, self.place):
            return
        self._refuse_unread(text)
        assigned: list[syntax.Statement] = []
        while not scanner.at_end:
            mark = scanner.mark()
            if self.tables.take_word(scanner, self.place) or self._define(scanner):
                continue
            scanner.reset(mark)
            if scanner.accept("&") and (system := scanner.take_integer()) is not None:
                self.commands.append(f"&{system}")
                continue
            scanner.reset(mark)
            setting = _setting(scanner)
            if setting is None:
                scanner.reset(mark)
                rest = text[scanner.position :].strip()
                if _UNDEFINE.fullmatch(rest):
                    self.definitions.clear()
                    self.undefines = True
                self.tables.address(rest)
                self.commands.append(rest)
                break
            assigned.append(setting)
        if assigned:
            self.settings.append(tuple(assigned))
            self.setting_places.append(self.place)

    def _refuse_unread(self, text: str) -> None:
        """Refuse a line with a word that is none; what belongs into a buffer is told by the reading after it."""
        try:
            self.on_line(text)
        except PmacError as error:
            if error.code is not ErrorCode.NO_BUFFER_OPEN:
                raise

    def _define(self, scanner: Scanner) -> bool:
        if not scanner.accept("#"):
            return False
        motor = scanner.take_integer()
        if motor is None or not scanner.accept("->") or scanner.at_end or scanner.peek("#&,"):
            return False
        definition = scan_definition(scanner, motor)
        if definition is not None and definition.inverse:
            self._refuse_without(f"#{motor}->I")
        self.definitions.pop(motor, None)
        if definition is not None:
            self.definitions[motor] = definition
        return True


def _setting(scanner: Scanner) -> syntax.Assign | None:
    """Parse an assignment; None when it is an on-line command (`I100=*` is one).

    Raises PmacError: 005, a statement that is only valid in a buffer.
    """
    rest = scanner.rest
    try:
        statement = parse_statement(scanner)
    except PmacError:
        if rest.endswith("=*"):
            return None
        raise
    if isinstance(statement, syntax.Assign) and not statement.synchronous:
        return statement
    buffered = isinstance(statement, _BUFFERED) or (
        isinstance(statement, syntax.Move) and statement.words[0].axis not in _ON_LINE_LETTERS
    )
    if buffered:
        raise PmacError(ErrorCode.NO_BUFFER_OPEN, f"{rest[:20]} outside of OPEN PROG and CLOSE")
    return None
