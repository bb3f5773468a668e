"""A transcript as a person reads it: where somebody only waits, the first look stands for all that are like it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import groupby

LOOK = re.compile(r"(?P<renewal>(?:M\d+|I\d+)=\d+ )?#\d+P F \? .*")
WATCHDOG = re.compile(r"(?:M\d+|I\d+)=\d+(?: P1002)?")
_ITEM = r"(?: [IP]\d+(?:\.\.\d+|,\d+,\d+)?| RH[XY]:\$[0-9A-F]+| (?:#\d+|M\d+)-> &1)"
BESIDE = re.compile(rf"(?:M\d+|I\d+)=\d+{_ITEM}+")
"""Some of what shapes the cut that runs, read between two looks."""
ENTRIES = re.compile(r"-?\d+(?: -?\d+){15}")
LONG_ANSWER = 4
UNFOLDED = 2
"""So many looks in a row stand there as they are."""


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """A line to the controller with everything that was said until the next one."""

    lines: tuple[str, ...]

    @property
    def said(self) -> str:
        """What was sent, without its time."""
        _, mark, text = self.lines[0].split(" ", 2)
        return text if mark == ">" else ""

    @property
    def waits(self) -> bool:
        """Whether somebody only looks on, or renews the watchdog timer."""
        return any(each.fullmatch(self.said) is not None for each in (LOOK, WATCHDOG, BESIDE))


def exchanges(lines: Sequence[str]) -> list[Exchange]:
    """Return the lines in groups that begin with one to the controller."""
    groups: list[list[str]] = []
    for line in lines:
        if not groups or " > " in line or " ! " in line:
            groups.append([])
        groups[-1].append(line)
    return [Exchange(lines=tuple(group)) for group in groups]


def folded(lines: Sequence[str]) -> list[str]:
    """Return the lines, of each wait the first and the last look, and at the end what identifies every byte.

    A long answer that was given before is not repeated, nor are the entries of a table: it is read back.
    """
    shown: list[str] = []
    given: set[tuple[str, ...]] = set()
    entries = 0
    for waits, group in groupby(exchanges(lines), key=lambda each: each.waits):
        if waits:
            shown += _folded(tuple(group))
            continue
        for each in group:
            entries = entries + 1 if ENTRIES.fullmatch(each.said) else 0
            shown += _once(each, given) if entries <= UNFOLDED else ()
    text = "".join(f"{line}\n" for line in lines)
    return [*shown, f"# {len(lines)} lines, sha256 {sha256(text.encode('utf-8')).hexdigest()}"]


def _once(exchange: Exchange, given: set[tuple[str, ...]]) -> Iterator[str]:
    """Give the lines of an exchange, without a long answer that was given before."""
    words = tuple(line.partition(" ")[2] for line in exchange.lines)
    if len(words) <= LONG_ANSWER or words not in given:
        given.add(words)
        yield from exchange.lines
        return
    yield exchange.lines[0]
    yield f"# {len(words) - 2} more lines, as they were answered before"
    yield exchange.lines[-1]


def _folded(group: Sequence[Exchange]) -> Iterator[str]:
    """Give the lines of exchanges that all wait, or of which none does."""
    looks = [place for place, each in enumerate(group) if LOOK.fullmatch(each.said)]
    if len(looks) <= UNFOLDED:
        yield from (line for each in group for line in each.lines)
        return
    first, last = looks[0], looks[-1]
    for each in group[: first + 1]:
        yield from each.lines
    between = group[first + 1 : last]
    renewals = sum(WATCHDOG.match(each.said) is not None for each in between)
    yield f"# {len(looks) - 2} more polls like this, the watchdog timer renewed {renewals} times"
    for each in group[last:]:
        yield from each.lines
