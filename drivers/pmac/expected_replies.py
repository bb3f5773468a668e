"""Predict the reply to a line from its commands, before it is sent.

Only what is certain is predicted: for a line with a command that is not known here, neither the number of reply
lines, nor that it may be sent twice.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from drivers.errors import out_of_step

_NUMBER = r"[-+]?(?:\$[0-9A-F]++|\d++(?:\.\d*+)?|\.\d++)"
_END_OF_VALUE = r"(?![\w.])(?!\s*(?:[-+*/|^&%(=<>]|\.\.))"
"""Where a number is the whole value, not the beginning of an expression."""

_GAP = r"(?=[\s,]|$)"


@dataclass(frozen=True, slots=True)
class ExpectedReplies:
    """`lines` of data in the reply, None if uncertain; `reads_only`: nothing on the controller changes."""

    lines: int | None
    reads_only: bool


_Rule = tuple[re.Pattern[str], Callable[[re.Match[str]], int | None], bool]
"""A command, the number of its data lines, and whether it only reads."""


def _rule(pattern: str, lines: int | None, *, reads: bool) -> _Rule:
    return re.compile(pattern), lambda _: lines, reads


def _range_lines(found: re.Match[str]) -> int | None:
    first, last, count, step = (found[name] for name in ("first", "last", "count", "step"))
    if last is not None:
        return max(0, int(last) - int(first) + 1)
    if count is None:
        return 1
    return None if step is None else int(count)  # P1,5 without a step appears in no known manual


_VARIABLES = r"(?P<first>\d++)(?:\.\.(?P<last>\d++)|,(?P<count>\d++)(?:,(?P<step>\d++))?)?"
_PLACE = r"(?:DP|TWB|TWD|TWR|TWS|[XYDLF])\s*:?\s*\$?[0-9A-F]++(?:,\w++)*+"
_LISTED = r"PROG(?:RAM)?|PLCC?|INV(?:ERSE)?|FORWARD|FWD|GATHER|GAT|COMP\s*DEF|COMP|PC|PE"

_RULES = (
    _rule(rf"LIST\s*(?:{_LISTED})\s*[\d, ]*+(?![^\s\d])", None, reads=True),
    _rule(r"(?:VERSION|VER|TYPE|DATE|CID|CPU|VID|CHECKSUM|CHKS|SIZE|TIME|TODAY|PC|PE)(?![A-Z])", 1, reads=True),
    _rule(r"RH?(?:X|Y|L|DP?|F)\s*:?\s*(?:\$[0-9A-F]++|\d++)(?:,\d++)?" + _GAP, None, reads=True),
    _rule(r"\?{1,3}", 1, reads=True),
    _rule(r"##?\d++->(?=\s*(?:[#&]|$))", 1, reads=True),
    (re.compile(rf"M{_VARIABLES}->(?=\s*(?:[#&IPQM?]|$))"), _range_lines, True),
    _rule(r"(?:##?|&)\d++(?!->)", 0, reads=True),
    _rule(rf"M{_VARIABLES}->(?:\*|{_PLACE})" + _GAP, 0, reads=False),
    _rule(rf"[IPQM]{_VARIABLES}\s*=\s*(?:{_NUMBER}|\*)" + _END_OF_VALUE, 0, reads=False),
    (re.compile(rf"[IPQM]{_VARIABLES}(?!\s*(?:=|->|\.\.|,|\())"), _range_lines, True),
    _rule(r"[PVF](?![\d(])", 1, reads=True),
    _rule(rf"%(?!\s*(?:{_NUMBER}))", 1, reads=True),
    _rule(rf"%\s*{_NUMBER}", 0, reads=False),
    _rule(r"OPEN\s*(?:PROG(?:RAM)?|PLC)\s*\d++|CLEAR|CLR|CLOSE|CLS", 0, reads=False),
    _rule(r"(?:ENABLE|ENA|DISABLE|DIS)\s*PLCC?\s*\d++(?:(?:,|\.\.)\d++)*+", 0, reads=False),
    _rule(r"DELETE\s*(?:PROG(?:RAM)?|PLCC?)\s*\d++|DELETE\s*GATHER|DEFINE\s*GATHER\s*\d*+", 0, reads=False),
    _rule(r"ENDGATHER|ENDG|GATHER|GAT", 0, reads=False),
    _rule(rf"J(?:[+/]|-(?!\d)|[=:^]={_NUMBER}|=\*|[=:^](?:{_NUMBER})?)(?![\^\w.])", 0, reads=False),
    _rule(rf"HOMEZ?|HMZ?|B\d++|O{_NUMBER}|[KARSQH](?![A-Z(\d])", 0, reads=False),
)
_BETWEEN = re.compile(r"[\s;]*+")

# float() also takes `nan`, `inf` and `1_0`, which no controller sends: one altered character must not become one.
_DECIMAL = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:E[-+]?\d{1,3})?", re.IGNORECASE | re.ASCII)
_HEXADECIMAL = re.compile(r"\$[0-9A-F]{1,16}", re.IGNORECASE | re.ASCII)
SHOWN = 40
"""Most characters of a line or a reply that an error names."""

_QUOTED = re.compile(r'"[^"]*"?')
_NAME = re.compile(r"^[IPQM]\d+=")
_BUFFERS = re.compile(r"OPEN(?=\s*[A-Z])|CLOSE|CLS")


@lru_cache(maxsize=512)
def expected_replies(line: str) -> ExpectedReplies:
    """Return what is certain about the reply to an on-line command line."""
    text, place = line.upper(), 0
    lines: int | None = 0
    reads_only = True
    place = _skip(text, place)
    while place < len(text):
        found = next(((rule, match) for rule in _RULES if (match := rule[0].match(text, place))), None)
        if found is None:
            return ExpectedReplies(None, False)
        (_, lines_of, reads), match = found
        more = lines_of(match)
        lines = None if lines is None or more is None else lines + more
        reads_only = reads_only and reads
        place = _skip(text, match.end())
    return ExpectedReplies(lines, reads_only)


@lru_cache(maxsize=512)
def opens_buffer(line: str) -> bool | None:
    """Return whether a buffer is open after a line, None when the line does not affect that."""
    words = _BUFFERS.findall(_QUOTED.sub("", line.upper()))
    return words[-1] == "OPEN" if words else None


def number_of(text: str) -> float:
    """Return the number in the report of a variable, in any form of I9 (`$C000`, `I5=2`).

    Raises ValueError, with the text: it is not a number, or none that a controller has.
    """
    digits = _NAME.sub("", text.strip())
    if _HEXADECIMAL.fullmatch(digits):
        return float(int(digits[1:], 16))
    if not _DECIMAL.fullmatch(digits) or math.isinf(value := float(digits)):
        raise ValueError(text[:SHOWN])
    return value


def replied_number(answer: str, where: str, line: str) -> float:
    """Return a reply of the controller at `where` to a line as a number. `link.out_of_step`: it is none."""
    try:
        return number_of(answer)
    except ValueError as error:
        raise out_of_step(where, line[:SHOWN], str(error)) from error


def _skip(text: str, place: int) -> int:
    found = _BETWEEN.match(text, place)
    return place if found is None else found.end()
