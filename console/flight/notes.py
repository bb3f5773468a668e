"""What happened between two states: keys, commands, stops, lines of the link; and the queue in which it waits."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from console.session.station.commands import Command

WAITING = 4000
"""Entries that wait for the recorder, which takes them ten times a second; the rest is lost, and counted."""


class NoteKind(StrEnum):
    """Kinds of notes. `left_out` and `lost` tell what the recording does not have."""

    KEY = "key"
    COMMAND = "command"
    STOP = "stop"
    KILL = "kill"
    LINK = "link"
    LEFT_OUT = "left_out"
    LOST = "lost"
    FROZEN = "frozen"


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """One event, at machine time, in words that do not depend on a language."""

    at_s: float
    kind: NoteKind
    text: str


Heard = tuple[float, str, str | bytes]
"""Time, the name of a kind or the mark of bytes of the link, and the words or the bytes."""


class Inbox:
    """Takes what is to be recorded, from any thread and from a signal handler; it never waits."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self._waiting: deque[Heard] = deque()
        self._lost = 0  # without a lock, because a signal handler may come in between: at least so many

    def put(self, kind: str, words: str | bytes) -> None:
        """Append an entry, unless too many are waiting."""
        if len(self._waiting) >= WAITING:
            self._lost += 1
        else:
            self._waiting.append((self._now_s(), kind, words))

    def take_entries(self) -> tuple[list[Heard], int]:
        """Return what waited, in its order, and how many entries were lost since the last time."""
        found = [self._waiting.popleft() for _ in range(len(self._waiting))]
        lost, self._lost = self._lost, 0
        return found, lost


def command_words(command: Command) -> str:
    """Return a command with those of its arguments that are short."""
    pairs = ((field.name, getattr(command, field.name)) for field in fields(command))
    shown = [f"{name}={value}" for name, value in pairs if isinstance(value, str | int | float)]
    return " ".join([type(command).__name__, *shown])
