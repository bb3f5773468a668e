"""Limits on the size of a trace file. A larger one is refused with its size before it uses memory.

A thousand turns of 360 points, or a hundred of 3600, are within. A small file may have large content: an
archive unpacks to a thousand times its size, an element of two letters costs a hundred bytes.

Problem code: `trace.too_large`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from profiles.problem import ProfileError, refused

MOST_POINTS = 500_000
MOST_LINES = 2 * MOST_POINTS
"""Half of them blank, or remarks."""

MOST_HEADER_LINES = 1000
"""Lines `# key: value`."""

_WORD = re.compile(r"\S+")


def lines_of(text: str, where: str) -> Iterator[str]:
    """Return an iterator over the lines of a text, as `split` does, without creating all of them at once.

    Raises `ProfileError`: `trace.too_large`, there are more than `MOST_LINES`.
    """
    count = text.count("\n") + 1
    if count > MOST_LINES:
        raise too_large(where, f"{count} lines", f"{MOST_LINES} lines")
    return _split(text)


def words_of(line: str) -> Iterator[str]:
    """Return an iterator over the words of a line: it may contain a million."""
    return (found.group() for found in _WORD.finditer(line))


def too_large(where: str, met: str, most: str) -> ProfileError:
    """Return the refusal of a file above a limit."""
    return refused("trace.too_large", where=where, value=met, limit=f"<= {most}")


def _split(text: str) -> Iterator[str]:
    begin = 0
    while (end := text.find("\n", begin)) >= 0:
        yield text[begin:end]
        begin = end + 1
    yield text[begin:]
