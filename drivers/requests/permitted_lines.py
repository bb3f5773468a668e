"""Which lines may be sent beside the polls, in both families: queries, and the set-up of data gathering.

A line is permitted only where every command in it is known to change nothing (`expected_replies`), and where its
reply has a known, small number of lines, or is a listing. Whatever else is typed is refused, with what does it
properly. A register of the hardware (an encoder, a DAC) is not read by address: reading a captured position resets
its trigger, and a home search would miss it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum, auto

from drivers.errors import RefusedError
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import expected_replies
from profiles.problem import Problem

MOST_LINES = 40  # values in one reply: a tenth of a second at 38400 baud
MOST_WORDS = 16  # words of memory in one reply
LONGEST = 120  # characters of a typed line
WATCHED_CHARACTERS = 24  # of one watched item

HARDWARE = {"pmac": 0xC000, "turbo": 0x70000}
"""The first address that is no memory, by family: input and output registers (Software References, memory map)."""


class RequestKind(Enum):
    """What a request may disturb."""

    QUERY = auto()
    """A short query, as a poll is one: also in motion, also by an observer."""
    LISTING = auto()
    """A long reply: at rest, by the console that controls the machine."""
    GATHER = auto()
    """Takes the gather buffer: by the console that controls the machine."""


@dataclass(frozen=True, slots=True)
class Permission:
    """What a line is, and the lines of its reply, None where only the reply shows how many."""

    kind: RequestKind
    lines: int | None


_MEMORY = re.compile(r"RH?(X|Y|L|DP?|F)\s*:?\s*(\$[0-9A-F]+|\d+)(?:\s*,\s*(\d+))?")
_ASSIGNED = re.compile(r"[IPQM]\d+(?:\.\.\d+)?\s*=\s*\S*")
_WORD = re.compile(r"J/|[A-Z]+|[\\/]")
_MOVES = {
    **dict.fromkeys(("HM", "HMZ", "HOME", "HOMEZ"), "home"),
    "J/": "enable",
    "J": "jog",
    **dict.fromkeys(("B", "R", "S", "RUN", "STEP"), "run"),
    "O": "open_loop",
    "K": "kill",
    **dict.fromkeys(("A", "H", "Q", "\\", "/", "ABR", "HOLD"), "stop"),
}
"""What the words of a line would do to a motion."""
_GATHER = re.compile(r"DEFINE GATHER \d+|GATHER|ENDGATHER|DELETE GATHER")
_SETTING = re.compile(r"I(\d+)=(\d+)")


def permission(line: str, dialect: Dialect) -> Permission:
    """Return what a typed line is.

    Raises RefusedError: `terminal.moves` with a word for what it does in `key`, `terminal.writes`,
        `terminal.hardware`, `terminal.too_long`, `terminal.unreadable`.
    """
    text = line.upper()  # not stripped: a control character at its end would be sent with it
    if not text.strip() or len(text) > LONGEST or not (text.isascii() and text.isprintable()):
        raise RefusedError(Problem(code="terminal.unreadable", value=line[:40], limit=f"<= {LONGEST}"))
    expected = expected_replies(text)
    if not expected.reads_only:
        raise RefusedError(_refusal(text))
    _refuse_hardware(text, dialect)
    if expected.lines is None and "LIST" in text:
        return Permission(RequestKind.LISTING, None)
    lines = _lines(text, expected.lines)
    if lines > MOST_LINES:
        raise RefusedError(Problem(code="terminal.too_long", value=str(lines), limit=f"<= {MOST_LINES}"))
    return Permission(RequestKind.QUERY, expected.lines)


def parse_watch_item(item: str, dialect: Dialect) -> str:
    """Return the text of an item that can be watched: a query with one line in its reply.

    Raises RefusedError: as `permission`, and `terminal.not_one`.
    """
    text = item.strip(" ").upper()
    found = permission(text, dialect)
    one = found.kind is RequestKind.QUERY and (found.lines == 1 or _MEMORY.fullmatch(text) is not None)
    if not one or len(text) > WATCHED_CHARACTERS or "," in text:
        raise RefusedError(Problem(code="terminal.not_one", value=item[:40]))
    return text


def gathers(line: str, dialect: Dialect) -> bool:
    """Whether a line sets up, starts or ends data gathering, and does nothing else."""
    if _GATHER.fullmatch(line):
        return True
    places = dialect.gathering
    sources = range(places.first_source, places.first_source + places.source_count)
    found = [_SETTING.fullmatch(each) for each in line.split()]
    return bool(found) and all(
        each is not None and (int(each[1]) in (places.period, *places.masks) or int(each[1]) in sources)
        for each in found
    )


def _lines(text: str, lines: int | None) -> int:
    words = sum(int(count or 1) for _, _, count in _MEMORY.findall(text))
    if words > MOST_WORDS:
        raise RefusedError(Problem(code="terminal.too_long", value=str(words), limit=f"<= {MOST_WORDS}"))
    return words if lines is None else lines


def _refuse_hardware(text: str, dialect: Dialect) -> None:
    for _, digits, count in _MEMORY.findall(text):
        address = int(digits[1:], 16) if digits.startswith("$") else int(digits)
        if address + int(count or 1) > HARDWARE[dialect.name]:
            limit = f"< ${HARDWARE[dialect.name]:X}"
            raise RefusedError(Problem(code="terminal.hardware", value=f"${address:X}", limit=limit))


def _refusal(text: str) -> Problem:
    """Return why a line is refused: by what of it would move something, else because it would change something."""
    words = _WORD.findall(_ASSIGNED.sub(" ", text))
    moves = next((_MOVES[word] for word in words if word in _MOVES), None)
    if moves is not None:
        return Problem(code="terminal.moves", key=moves, value=text[:40])
    return Problem(code="terminal.writes", value=text[:40])
