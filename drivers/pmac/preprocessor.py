"""The preprocessor of the maker's editor: #define, #undef, #include, #ifdef, #ifndef, #else and #endif.

It works line by line before anything is sent, and every line keeps its place in the text. A name is replaced
where it is a whole word, as it was typed, also inside the quotes of CMD and not in those of other texts. In a
word that ends in digits the longest name before them counts (`VarAdr30` for a name VarAdr): a choice. What it
stands for may contain further names. Comments are `; ...`, `// ...` and `/* ... */`, also over several lines; a
controller knows the first alone. Nothing else is carried out: #if and names with arguments are refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from drivers.pmac.language.errors import ErrorCode, PmacError

MOST_LEVELS = 10  # of files that include one another
MOST_LINES = 250_000  # with all included files; the backup of a full controller has 150,000
MOST_REPLACEMENTS = 20  # of names by names in one line
MOST_CHARACTERS = 10_000  # of a line after that

Include = Callable[[str], str]
"""Returns the text of an included file. Raises PmacError: it cannot be read."""

_DIRECTIVE = re.compile(r"\s*#\s*(define|include|undef|ifdef|ifndef|if|elif|else|endif)\b\s*(.*)", re.IGNORECASE)
_PIECE = re.compile(r'"[^"]*"?|/\*.*?(?:\*/|$)|//.*|;.*|[^"/;]+|/')  # what begins in quotes is no comment
_NAME = re.compile(r"[A-Za-z_]\w*")
_DEFINITION = re.compile(r"([A-Za-z_]\w*)(\(?)\s*(.*)")
_FILE = re.compile(r'"([^"]+)"|<([^>]+)>|(\S+)')
_COMMAND = re.compile(r"(?:CMD|COMMAND)[SPRA]?\s*$", re.IGNORECASE)


class LineNumber(int):
    """A line of a text, from 1; one of an included file is the line of its #include, and has a `source`.

    It is used as the number. Two lines of included files are not the same, though one #include has brought both,
    and neither is the line of that #include: a number is equal to a line of the text itself only.
    """

    source: str

    def __new__(cls, line: int, source: str = "") -> LineNumber:
        """Make it of a line of the main text, and a source such as `limits.h:5`."""
        made = super().__new__(cls, line)
        made.source = source
        return made

    @property
    def line_name(self) -> str:
        """The line in the text, and in the included file: `12`, or `12, limits.h:5`."""
        return f"{int(self)}, {self.source}" if self.source else str(int(self))

    def __eq__(self, other: object) -> bool:
        """Compare the source, too; a number has none."""
        if isinstance(other, LineNumber):
            return (int(self), self.source) == (int(other), other.source)
        return not self.source and int(self) == other

    def __ne__(self, other: object) -> bool:
        """Return the contrary of equality."""
        return not self == other

    __hash__ = int.__hash__


@dataclass(frozen=True, slots=True)
class SourceLine:
    """A line to send, without its comment. With an `error` it is a directive that cannot be carried out."""

    text: str
    place: LineNumber
    error: PmacError | None = None


def preprocess(text: str, include: Include | None = None) -> Iterator[SourceLine]:
    """Yield the lines that are sent, empty ones left out. Without `include` no other file can be included."""
    reader = _SourceReader(include)
    yield from reader.lines(text, "", None, 0)
    if reader.conditions:
        yield SourceLine("#ifdef", reader.conditions[-1].place, _refusal("#ifdef without #endif"))


@dataclass(slots=True)
class _Condition:
    place: LineNumber
    holds: bool
    turned: bool = False


@dataclass(slots=True)
class _SourceReader:
    include: Include | None
    names: dict[str, str] = field(default_factory=dict)
    conditions: list[_Condition] = field(default_factory=list)
    count: int = 0
    opened: list[str] = field(default_factory=list)
    comment_from: int = 0  # the line of its file in which a comment of several lines has begun; 0 in none

    def lines(self, text: str, name: str, place: LineNumber | None, level: int) -> Iterator[SourceLine]:
        """Yield the lines of a file; `place` is that of its #include, None of the main text."""
        for number, raw in enumerate(text.splitlines(), start=1):
            at = LineNumber(number) if place is None else LineNumber(place, f"{name}:{number}")
            line = self._strip_comments(raw, number)
            self.count += 1
            try:
                if self.count > MOST_LINES:
                    raise _refusal(f"more than {MOST_LINES} lines with all that is included")
                directive = _DIRECTIVE.match(line)
                if directive is not None:
                    yield from self._directive(directive[1].lower(), directive[2].strip(), at, level)
                elif line and self._active:
                    yield SourceLine(self._replace_names(line), at)
            except PmacError as error:
                yield SourceLine(line, at, error)
                if self.count > MOST_LINES:
                    return

        if begun := self.comment_from:
            self.comment_from = 0
            at = LineNumber(begun) if place is None else LineNumber(place, f"{name}:{begun}")
            yield SourceLine("/*", at, _refusal("/* without */: all behind it is a comment"))

    def _strip_comments(self, raw: str, number: int) -> str:
        raw = f"/*{raw}" if self.comment_from else raw
        pieces = _PIECE.findall(raw)
        last = pieces[-1] if pieces else ""
        is_open = last.startswith("/*") and (last == "/*/" or not last.endswith("*/"))
        self.comment_from = (self.comment_from or number) if is_open else 0
        kept = (" " if each.startswith("/*") else each for each in pieces if not each.startswith(("//", ";")))
        return "".join(kept).strip()

    @property
    def _active(self) -> bool:
        return all(condition.holds for condition in self.conditions)

    def _directive(self, word: str, rest: str, place: LineNumber, level: int) -> Iterator[SourceLine]:
        if word in ("ifdef", "ifndef"):
            name = _name(word, rest)
            self.conditions.append(_Condition(place, (name in self.names) == (word == "ifdef")))
        elif word in ("else", "endif"):
            if not self.conditions or (word == "else" and self.conditions[-1].turned):
                raise _refusal(f"#{word} without #ifdef")
            if word == "endif":
                self.conditions.pop()
            else:
                self.conditions[-1].holds, self.conditions[-1].turned = not self.conditions[-1].holds, True
        elif not self._active:
            return
        elif word == "define":
            self._define(rest)
        elif word == "undef":
            self.names.pop(_name(word, rest), None)
        elif word == "include":
            yield from self._include_file(rest, place, level)
        else:
            raise _refusal(f"#{word} is not carried out; #ifdef and #ifndef are")

    def _define(self, rest: str) -> None:
        found = _DEFINITION.fullmatch(rest)
        if found is None:
            raise _refusal("a name as in #define SPEED 20")
        if found[2]:
            raise _refusal(f"#define {found[1]}(...): a name with arguments is not carried out")
        self.names[found[1]] = found[3].strip()

    def _include_file(self, rest: str, place: LineNumber, level: int) -> Iterator[SourceLine]:
        found = _FILE.fullmatch(rest)
        if found is None:
            raise _refusal('a file as in #include "limits.h"')
        if self.include is None:
            raise _refusal("#include: other files are not read here")
        if level == MOST_LEVELS:
            raise _refusal(f"#include more than {MOST_LEVELS} files deep")
        name = found[1] or found[2] or found[3]
        if name in self.opened:
            raise _refusal(f"#include {name}: it includes itself")
        text = self.include(name)
        self.opened.append(name)
        yield from self.lines(text, name, place, level + 1)
        self.opened.pop()

    def _replace_names(self, line: str) -> str:
        """Replace the names of a line, again while there are any."""
        for _ in range(MOST_REPLACEMENTS):
            pieces = line.split('"')
            for place, piece in enumerate(pieces):
                if place % 2 == 0 or _COMMAND.search(pieces[place - 1]):
                    pieces[place] = _NAME.sub(self._value, piece)
            replaced = '"'.join(pieces)
            if replaced == line:
                return line
            if len(replaced) > MOST_CHARACTERS:
                break
            line = replaced
        raise _refusal("a name that is defined by itself, or too long a line")

    def _value(self, word: re.Match[str]) -> str:
        """Return what a word stands for."""
        if (whole := self.names.get(word[0])) is not None:
            return whole
        for end in range(len(word[0]) - 1, 1, -1):
            if not word[0][end].isdigit():
                break
            if (name := self.names.get(word[0][:end])) is not None:
                return name + word[0][end:]
        return word[0]


def _name(word: str, rest: str) -> str:
    if _NAME.fullmatch(rest) is None:
        raise _refusal(f"a name as in #{word} SPEED")
    return rest


def _refusal(detail: str) -> PmacError:
    return PmacError(ErrorCode.DATA_ERROR, detail)
