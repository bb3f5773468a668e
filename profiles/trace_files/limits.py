"""The text of a trace file, and limits on its size: a larger one is refused before it uses memory.

A thousand turns of 360 points, or a hundred of 3600, are within. A small file may have large content: an archive
unpacks to a thousand times its size, an element of two letters costs a hundred bytes. Text is UTF-8 with or
without a byte order mark, or UTF-16 with one, as spreadsheets save "Unicode text"; lines end with LF, CR LF or CR.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator

from profiles.files import refuse_nul
from profiles.problem import ProfileError, refusal_error

MOST_POINTS = 500_000
MOST_LINES = 2 * MOST_POINTS  # half of them blank, or remarks
MOST_HEADER_LINES = 1000  # lines `# key: value`
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def text_of(content: bytes, where: str, code: str) -> str:
    """Return bytes as text; `code` is that of the refusal of what is no text, `file.nul_bytes` the other."""
    marked = content.startswith(_UTF_16)
    if not marked:
        refuse_nul(content, where)
    encoding = "utf-16" if marked else "utf-8-sig"
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise refusal_error(code, where=f"{where}:{line}", value=f"0x{content[error.start]:02x}") from error


def decode_trace_text(content: bytes, where: str) -> str:
    """Return the text of a trace file with LF at the end of each line."""
    text = text_of(content, where, "trace.not_utf8")
    if not text.strip():
        raise refusal_error("trace.empty", where=where)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def lines_of(text: str, where: str) -> Iterator[str]:
    """Return an iterator over the lines of a text, which are not all created at once."""
    count = text.count("\n") + 1
    if count > MOST_LINES:
        raise too_large(where, f"{count} lines", f"{MOST_LINES} lines")
    return (found.group() for found in re.finditer(r"^.*$", text, re.MULTILINE))


def words_of(line: str) -> Iterator[str]:
    """Return an iterator over the words of a line: it may contain a million."""
    return (found.group() for found in re.finditer(r"\S+", line))


def too_large(where: str, actual: str, most: str) -> ProfileError:
    """Return the refusal of a file above a limit."""
    return refusal_error("trace.too_large", where=where, value=actual, limit=f"<= {most}")
