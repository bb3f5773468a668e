"""Terminal-safe text: escape control characters, replace what the encoding lacks.

Names, files and replies of a controller may contain anything. This is done once, where text becomes output:
in the streams of the command line, and in the panels of the screens.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
import unicodedata
from collections.abc import Iterable

CELLS = "console.cells"
"""Name of the error handler that keeps the width of what it replaces, for a stream of another encoding."""

# Faster than checking each character, and nearly every text has none of them.
_STRANGE = re.compile(r"[^\n\t\x20-\x7e\uac00-\ud7a3]+")

LIKE = str.maketrans(
    {
        **dict.fromkeys("·∙–—─╌", "-"),
        **dict.fromkeys("│┃", "|"),
        **dict.fromkeys("└├┤┼┌┐┘┬┴╭╮╰╯", "+"),
        **dict.fromkeys("→▶▸", ">"),
        **dict.fromkeys("←◀◂", "<"),
        **dict.fromkeys("■●█▌▐▓", "#"),
        **dict.fromkeys("□○", "o"),
        **dict.fromkeys("░▒", "."),
        **dict.fromkeys("✗×", "x"),
        **dict.fromkeys(map(chr, range(0x2801, 0x2900)), "*"),  # dots of the plots
        "✓": "v",
        "↑": "^",
        "↓": "v",
        "≡": "=",
        "²": "2",
        "…": ".",
        "°": "d",
        "µ": "u",
        "μ": "u",
    }
)


SPELLED = {"±": "+/-", "…": "...", "≤": "<=", "≥": ">=", "≠": "!="}
"""Signs that more than one character of ASCII stands for, where a line may get longer."""


def spell_unencodable(text: str, encoding: str | None) -> str:
    """Return a text whose signs are spelled out that this encoding has not."""
    if text.isascii() or encoding is None:
        return text
    for sign, ascii_ones in SPELLED.items():
        if sign in text and not can_write(sign, encoding):
            text = text.replace(sign, ascii_ones)
    return text


def can_write(text: str, encoding: str | None) -> bool:
    """Whether an encoding has all characters of a text; one that Python does not know has."""
    try:
        text.encode(encoding or "utf-8")
    except UnicodeEncodeError:
        return False
    except LookupError:
        return True
    return True


FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""How a cell begins that a spreadsheet may take for a formula."""


def csv_table(columns: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return rows as CSV below a header; an apostrophe before a text that a spreadsheet would calculate."""
    written = io.StringIO()
    table = csv.writer(written, lineterminator="\n")
    table.writerow(columns)
    table.writerows([_cell(value) for value in row] for row in rows)
    return written.getvalue()


def _cell(value: object) -> object:
    if not isinstance(value, str):
        return value
    # What follows a line break would begin a row.
    return ("'" if value.startswith(FORMULA) else "") + escaped_line(value)


def escape_text(text: str) -> str:
    """Return a text in which nothing can control the terminal; line breaks and tabs stay."""
    return _STRANGE.sub(_printable, text)


def escaped_line(text: str) -> str:
    """Return the same for a text that must stay on its line."""
    if text.isprintable():
        return text
    return escape_text(text).replace("\n", r"\n").replace("\t", r"\t")


def encodable(text: str, encoding: str | None) -> str:
    """Return a text that this encoding can write, in as many cells; None accepts everything."""
    if encoding is None:
        return text
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return text.encode(encoding, CELLS).decode(encoding)
    except LookupError:  # not an encoding that Python knows
        return text
    return text


def _printable(found: re.Match[str]) -> str:
    return "".join(c if _harmless(c) else c.encode("unicode_escape").decode("ascii") for c in found[0])


def _harmless(character: str) -> bool:
    return character.isprintable() or unicodedata.category(character) == "Zs"


def _replace_unencodable(error: UnicodeError) -> tuple[str, int]:
    """Return the replacement for what an encoding lacks: something similar, or question marks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end].translate(LIKE)
    return "".join(_in_ascii(c) for c in lost), error.end


def _in_ascii(character: str) -> str:
    if character.isascii():
        return character
    if unicodedata.combining(character):
        return ""
    return "??" if unicodedata.east_asian_width(character) in "WF" else "?"


codecs.register_error(CELLS, _replace_unencodable)
