"""Programs that the console writes for a while and erases again: they state whose they are.

A controller keeps no comments, so such a program begins with a message in a branch that is never taken: a name,
and for each line behind it three digits of the checksum up to there. What a lost link has left behind, in whole or
in part, is known by it, whichever console wrote it. Another's program is not, nor one of ours that was changed.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import without_end
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.text import format_line

_NEVER, _END = "IF(1=0)", "ENDIF"
_NAMED = re.compile(r'SEND"trilobe ((?:[0-9A-F]{3})*)"')
_DIGITS = 3


def signed(text: str) -> str:
    """Return the text of one program, OPEN to CLOSE with lines before, with its signature behind its CLEAR."""
    before, clear, rest = text.rpartition("\nCLEAR\n")
    code = (line.partition(";")[0].strip() for line in rest.rpartition("CLOSE")[0].splitlines())
    body = [format_line(parse_line(line)) for line in code if line]
    name = f'SEND"trilobe {_checksums(body)}"'
    return "".join((before, clear, "\n".join((_NEVER, name, _END, rest))))


def is_signed(listing: Sequence[str]) -> bool:
    """Whether the listing of a program, in any form of I9, is one that `signed` has made, or its beginning."""
    try:
        lines = [format_line(parse_line(line)) for line in without_end(listing)]
    except PmacError:
        return False
    head, body = lines[:3], lines[3:]
    named = _NAMED.fullmatch(head[1]) if len(head) > 1 else None
    if named is None or head[0] != _NEVER:
        return head in ([], [_NEVER])  # ended before its name: too little to be anybody's
    known = _checksums(body)
    return named[1].startswith(known) and (not body or head[2] == _END)


def _checksums(lines: Sequence[str]) -> str:
    text = ("\n".join(lines[: count + 1]) for count in range(len(lines)))
    return "".join(f"{zlib.crc32(each.encode('ascii', 'replace')) % 16**_DIGITS:0{_DIGITS}X}" for each in text)
