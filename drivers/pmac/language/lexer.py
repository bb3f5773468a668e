"""Scanning one line of PMAC text on demand.

The controller's spelling is loose: case and white space do not matter, not even inside a word (`End While`,
`ta10ts10tm(P400)`, `i65???&1??%#1?PVFm190p99`), so only a parser knows which words are possible at the cursor.
White space does end a number: `$1 F100` is two tokens, and `X1 0` is refused.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from decimal import Decimal
from functools import lru_cache

from drivers.pmac.language.errors import ErrorCode, PmacError

HIGHEST_CHARACTER = 127
"""Characters above this are refused outside a comment (PMAC Software Reference, I6: ERR004)."""

_WHITE = frozenset(" \t\r\n")
# A point that begins `..` belongs to a range of variables (P1..3), not to the number before it.
_NUMBER = re.compile(r"\$[0-9A-F]+|[0-9]+(?:\.(?!\.)[0-9]*)?|\.[0-9]+")
_OTHER_FORM = re.compile(r'[$"]|\.(?!\.)|(?<![\d.])0\d')
_INTEGER = re.compile(r"\$[0-9A-F]{1,12}(?![0-9A-F])|[0-9]{1,18}(?![0-9])")
DECIMALS = 10  # Maximum decimals that `format_number` writes


def format_number(value: float) -> str:
    """Format a number rounded to 10 decimals: never an exponent, a trailing zero or `-0`."""
    if value % 1.0 == 0.0:
        return str(int(value))  # most of the thousands of values that a host may query at once
    return _plain(f"{value:.{DECIMALS}f}")


def format_constant(value: float) -> str:
    """Format a number with as many decimals as it takes to read the same number back; no exponent."""
    short = format_number(value)
    return short if float(short) == value else _plain(f"{Decimal(repr(float(value))):f}")


def _plain(digits: str) -> str:
    if "." in digits:
        digits = digits.rstrip("0").rstrip(".")
    return "0" if digits == "-0" else digits


class Scanner:
    """A cursor over the text of one line; a comment (`;` to the end) may contain any character."""

    def __init__(self, text: str) -> None:
        """Prepare a line. Raises PmacError 004: a character above 127 outside a comment."""
        self._cursor = 0
        self._text, self._columns, self._gaps = _condense(text)

    @property
    def at_end(self) -> bool:
        """Whether only white space and a comment are left."""
        return self._cursor >= len(self._text)

    @property
    def position(self) -> int:
        """The column of the cursor in the original line, from 0."""
        return self._columns[self._cursor]

    @property
    def rest(self) -> str:
        """The rest of the line: upper case, without white space and comment."""
        return self._text[self._cursor :]

    @property
    def inside_word(self) -> bool:
        """Whether the cursor is between two letters (or `$`) with no white space between them."""
        place = self._cursor
        if not 0 < place < len(self._text) or self._columns[place] != self._columns[place - 1] + 1:
            return False
        return _is_letter(self._text[place - 1]) and _is_letter(self._text[place])

    def mark(self) -> int:
        """Return the cursor, for `reset`."""
        return self._cursor

    def reset(self, mark: int) -> None:
        """Go back to a mark."""
        self._cursor = mark

    def text_between(self, begin: int, end: int) -> str:
        """Return the text between two marks as the controller keeps it: constants in decimals, texts as typed."""
        piece = self._text[begin:end]
        if _OTHER_FORM.search(piece) is None:
            return piece
        kept: list[str] = []
        here = self._cursor
        self._cursor = begin
        while self._cursor < end:
            text = self.take_string()
            if text is not None:
                kept.append(f'"{text}"')
                continue
            if self.accept(".."):
                kept.append("..")
                continue
            value = self.take_number() if self.peek("$.0123456789") else None
            if value is None:
                kept.append(self._text[self._cursor])
                self._cursor += 1
            else:
                kept.append(format_constant(value))
        self._cursor = here
        return "".join(kept)

    def peek(self, characters: str) -> bool:
        """Whether the next character is one of `characters`."""
        return self._cursor < len(self._text) and self._text[self._cursor] in characters

    def accept(self, word: str) -> bool:
        """Consume `word` (upper case, no spaces) if it is at the cursor."""
        if not self._text.startswith(word, self._cursor):
            return False
        self._cursor += len(word)
        return True

    def expect(self, word: str) -> None:
        """Consume `word`. Raises PmacError 003: something else is there."""
        if not self.accept(word):
            raise self.refusal(f"expected {word}")

    def take_word(self, words: tuple[str, ...]) -> str | None:
        """Consume the longest of `words` (upper case, no spaces) at the cursor."""
        return self.take(longest_of(words))

    def take(self, words: re.Pattern[str]) -> str | None:
        """Consume the longest of the words of a pattern of `longest_of` at the cursor."""
        found = words.match(self._text, self._cursor)
        if found is None:
            return None
        self._cursor = found.end()
        return found.group()

    def take_number(self) -> float | None:
        """Consume an unsigned constant: `12`, `12.5`, `.5` or, in hexadecimal, `$1F`. No exponent.

        Raises PmacError 003: a constant that no number can hold.
        """
        digits = self._match(_NUMBER)
        if digits is None:
            return None
        try:
            value = float(int(digits[1:], 16)) if digits[0] == "$" else float(digits)
        except OverflowError:
            value = float("inf")
        if value == float("inf"):
            raise self.refusal("constant too large")
        return value

    def take_integer(self) -> int | None:
        """Consume an unsigned integer of up to 18 digits, or up to 12 hexadecimal ones after `$`."""
        digits = self._match(_INTEGER)
        if digits is None:
            return None
        return int(digits[1:], 16) if digits[0] == "$" else int(digits)

    def take_string(self) -> str | None:
        """Consume a text in double quotes and return it as typed.

        Raises PmacError 003: the closing quote is missing.
        """
        if not self.peek('"'):
            return None
        end = self._text.find('"', self._cursor + 1)
        if end < 0:
            raise self.refusal("unfinished text")
        taken = self._text[self._cursor + 1 : end]
        self._cursor = end + 1
        return taken

    def refusal(self, reason: str) -> PmacError:
        """Return an ERR003 that names the place, for the caller to raise."""
        found = self.rest[:20] or "the end of the line"
        return PmacError(ErrorCode.DATA_ERROR, f"column {self.position + 1}: {reason}, found {found}")

    def _match(self, pattern: re.Pattern[str]) -> str | None:
        """Consume a match that ends at white space at the latest."""
        following = bisect_right(self._gaps, self._cursor)
        limit = self._gaps[following] if following < len(self._gaps) else len(self._text)
        found = pattern.match(self._text, self._cursor, limit)
        if found is None:
            return None
        self._cursor = found.end()
        return found.group()


def _is_letter(character: str) -> bool:
    return character.isalpha() or character == "$"


@lru_cache(maxsize=64)
def longest_of(words: tuple[str, ...]) -> re.Pattern[str]:
    """Return a pattern of the words; to find it again takes as long as to use it, so large tables keep it."""
    return re.compile("|".join(re.escape(word) for word in sorted(words, key=len, reverse=True)))


@lru_cache(maxsize=1024)
def _condense(text: str) -> tuple[str, list[int], list[int]]:
    """Return the line without white space and comment, the columns, and the places of the gaps.

    Cached: a host that polls its machine sends the same few lines many times a second.
    """
    kept: list[str] = []
    columns: list[int] = []
    gaps: list[int] = []
    quoted = False
    column = 0
    for column, character in enumerate(text):
        if ord(character) > HIGHEST_CHARACTER:
            raise PmacError(ErrorCode.ILLEGAL_CHARACTER, f"column {column + 1}: {character!r}")
        if character == '"':
            quoted = not quoted
        elif not quoted:
            if character == ";":
                break
            if character in _WHITE:
                gaps.append(len(kept))
                continue
            character = character.upper()
        kept.append(character)
        columns.append(column)
    else:
        column = len(text)
    return "".join(kept), [*columns, column], gaps
