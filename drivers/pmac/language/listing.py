"""Lines as the controller keeps and lists them: whole words, no blanks, everything else as it was typed.

`dwe 20` is listed `DWELL20`, `cmd "#1j+"` `COMMAND"#1j+"`; parentheses, ranges and the order of the words stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.parser import gather_moves, statements_of
from drivers.pmac.language.plc_statements import plc_statements_of, stored_lines
from drivers.pmac.language.syntax import Line, PlcLine, PlcStatement, Statement

END = "RETURN"
"""The last line of every listing, stored or not: the controller keeps the end of a program like that."""

_ENDS = (END, "RET")
_WHOLE = {
    "CMD": "COMMAND",
    "DWE": "DWELL",
    "DLY": "DELAY",
    "ENDI": "ENDIF",
    "ENDW": "ENDWHILE",
    "RET": END,
    "LIN": "LINEAR",
    "RPD": "RAPID",
    "CIR": "CIRCLE",
    "HM": "HOME",
    "HMZ": "HOMEZ",
    "BSTART": "BLOCKSTART",
    "BSTOP": "BLOCKSTOP",
    "ENAPLC": "ENABLEPLC",
    "DISPLC": "DISABLEPLC",
    "NRM": "NORMAL",
    "ADR": "ADDRESS",
    "DISP": "DISPLAY",
    "O": "N",
}
_SHORT = re.compile(
    r"CMD|DWE(?!LL)|DLY|ENDI(?!F)|ENDW(?!HILE)|RET(?!URN)|LIN(?!EAR)|RPD|CIR(?!CLE)|HMZ|HM|BSTART|BSTOP|ENAPLC|DISPLC"
    r"|NRM|ADR|DISP(?!LAY|LC)|O(?=\d)"
)


@dataclass(frozen=True, slots=True)
class StoredLine:
    """A line of a motion program: what it does, and how it is listed."""

    statements: Line
    text: str


@dataclass(frozen=True, slots=True)
class StoredPlcLine:
    """A line of a PLC: what it does, and how it is listed."""

    statements: PlcLine
    text: str


def stored_line(text: str) -> StoredLine:
    """Return a typed line as it is kept. Raises PmacError as `parse_line` does."""
    scanner = Scanner(text)
    spelled = list(_spelled(scanner, statements_of(scanner)))
    line = gather_moves(statement for statement, _ in spelled)
    return StoredLine(line, "".join(piece for _, piece in spelled))


def stored_plc_lines(text: str) -> tuple[StoredPlcLine, ...]:
    """Return the lines that a PLC keeps for a typed one; RETURN, the end of a listing, is none.

    Raises PmacError as `parse_plc_line` does.
    """
    scanner = Scanner(text)
    if scanner.rest in _ENDS:
        return ()
    spelled = list(_spelled_plc(scanner, plc_statements_of(scanner)))
    pieces = iter([piece for _, piece in spelled])
    lines = stored_lines(tuple(statement for statement, _ in spelled))
    return tuple(StoredPlcLine(line, "".join(next(pieces) for _ in line)) for line in lines)


def listed(texts: Sequence[str]) -> tuple[str, ...]:
    """Return a whole listing: the lines, and the end if they do not have it."""
    return tuple(texts) if texts and texts[-1] == END else (*texts, END)


def without_end(lines: Iterable[str]) -> tuple[str, ...]:
    """Return a listing as it was sent, without the end that the controller lists behind it."""
    kept = tuple(lines)
    return kept[:-1] if kept and kept[-1].strip().upper() in _ENDS else kept


def _spelled(scanner: Scanner, statements: Iterator[Statement]) -> Iterator[tuple[Statement, str]]:
    begin = scanner.mark()
    for statement in statements:
        yield statement, _piece(scanner, begin)
        begin = scanner.mark()


def _spelled_plc(scanner: Scanner, statements: Iterator[PlcStatement]) -> Iterator[tuple[PlcStatement, str]]:
    begin = scanner.mark()
    for statement in statements:
        yield statement, _piece(scanner, begin)
        begin = scanner.mark()


def _piece(scanner: Scanner, begin: int) -> str:
    piece = scanner.typed(begin, scanner.mark())
    short = _SHORT.match(piece)
    return piece if short is None else _WHOLE[short.group()] + piece[short.end() :]
