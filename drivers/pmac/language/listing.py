"""Lines as the controller keeps and lists them: no blanks, everything else as it was typed.

`dwe 20` is listed `DWELL20` in full and `DWE20` in short, `cmd "#1j+"` `COMMAND"#1j+"` and `CMD"#1j+"`;
parentheses, ranges and the order of the words stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import accumulate

from drivers.pmac.language.lexer import Scanner, longest_of
from drivers.pmac.language.parser import gather_moves, statements_of
from drivers.pmac.language.plc_statements import plc_statements_of, stored_lines
from drivers.pmac.language.syntax import Line, PlcLine, PlcStatement, Statement

END = "RETURN"
"""The last line of every listing, stored or not: the controller keeps the end of a program like that."""

_SHORT = {
    # The manuals give these two spellings, or use the short one in an example.
    "COMMAND": "CMD",
    "DWELL": "DWE",
    "ENDWHILE": "ENDW",
    "LINEAR": "LIN",
    END: "RET",
    # Public programs that read listings of real cards know these spellings; that cards list them is derived.
    "ADDRESS": "ADR",
    "BLOCKSTART": "BSTART",
    "BLOCKSTOP": "BSTOP",
    "CIRCLE1": "CIR1",
    "CIRCLE2": "CIR2",
    "DELAY": "DLY",
    "DISABLEPLC": "DISPLC",
    "ENABLEPLC": "ENAPLC",
    "ENDIF": "ENDI",
    "HOME": "HM",
    "HOMEZ": "HMZ",
    "NORMAL": "NRM",
    "PAUSEPLC": "PAUPLC",
    "RAPID": "RPD",
    "RESUMEPLC": "RESPLC",
}
"""How the word of a statement is listed in short. Any other word is listed whole, which is a choice."""

_ENDS = (END, _SHORT[END])
_WHOLE = {**{short: word for word, short in _SHORT.items()}, "DISP": "DISPLAY", "GOS": "GOSUB", "O": "N"}
"""The word that is kept for another spelling of it."""

_FULL = longest_of(tuple(_SHORT))
_TYPED = re.compile(rf"{longest_of(tuple({*_WHOLE.keys(), *_WHOLE.values()} - {'O', 'N'})).pattern}|O(?=\d)")


_CHARACTERS_A_WORD = 8  # how the real controller packs a line is not known


@dataclass(frozen=True, slots=True)
class KeptText:
    """The text of each statement, its word whole, and how many words of memory the line takes."""

    pieces: tuple[str, ...]
    words: int = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Count once: the address of a line is asked for at every poll."""
        words = -(-sum(map(len, self.pieces)) // _CHARACTERS_A_WORD)
        object.__setattr__(self, "words", words)  # frozen: this is how it is set

    @property
    def text(self) -> str:
        """The line as it is listed in full."""
        return "".join(self.pieces)

    def list_line(self, *, in_full: bool) -> str:
        """Return the line as it is listed, in full or in short."""
        return self.text if in_full else _shorten_pieces(self.pieces)


@dataclass(frozen=True, slots=True)
class StoredLine(KeptText):
    """A line of a motion program: what it does, and how it is listed."""

    statements: Line


@dataclass(frozen=True, slots=True)
class StoredPlcLine(KeptText):
    """A line of a PLC: what it does, and how it is listed."""

    statements: PlcLine


def stored_line(text: str) -> StoredLine:
    """Return a typed line as it is kept. Raises PmacError as `parse_line` does."""
    scanner = Scanner(text)
    spelled = list(_list_statements(scanner, statements_of(scanner)))
    line = gather_moves(statement for statement, _ in spelled)
    return StoredLine(tuple(piece for _, piece in spelled), line)


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
    return tuple(StoredPlcLine(tuple(next(pieces) for _ in line), line) for line in lines)


def with_end(lines: Sequence[KeptText]) -> tuple[KeptText, ...]:
    """Return the lines of a whole listing: those of the buffer, and the end if they do not have it."""
    return tuple(lines) if lines and lines[-1].text == END else (*lines, KeptText((END,)))


def addresses(lines: Iterable[KeptText]) -> list[int]:
    """Return where each line begins, in words of memory from the first one, and where the last one ends."""
    return list(accumulate((line.words for line in lines), initial=0))


def without_end(lines: Iterable[str]) -> tuple[str, ...]:
    """Return a listing as it was sent, without the end that the controller lists behind it."""
    kept = tuple(lines)
    return kept[:-1] if kept and kept[-1].strip().upper() in _ENDS else kept


def _list_statements(scanner: Scanner, statements: Iterator[Statement]) -> Iterator[tuple[Statement, str]]:
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
    piece = scanner.text_between(begin, scanner.mark())
    typed = _TYPED.match(piece)
    return piece if typed is None else _WHOLE.get(typed.group(), typed.group()) + piece[typed.end() :]


def _shorten_pieces(pieces: tuple[str, ...]) -> str:
    text = ""
    for piece in reversed(pieces):
        word = _FULL.match(piece)
        short = piece if word is None else _SHORT[word.group()] + piece[word.end() :]
        # ENDI in front of F100 would be read as ENDIF: such a word stays whole.
        doubtful = word is not None and (short + text).startswith(word.group())
        text = (piece if doubtful else short) + text
    return text
