"""What went over the link, kept in memory: for an engineer who wants to see what a key of the console sends.

The link's threads append, a signal handler among them; a screen reads. Polls come ten times a second and would
push everything else out, so they are kept apart.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

KEPT, POLLS_KEPT = 3000, 120  # pieces: a request and its reply are two or more
SENT, RECEIVED, STOP, FAILED = ">", "<", "!", "*"


@dataclass(frozen=True, slots=True)
class Piece:
    """Bytes in one direction, in order `number`; `mark` as in a trace."""

    number: int
    at_s: float
    mark: str
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Spoken:
    """One line of the list: a request with its data, a stop, or a failure, the text with its control characters.

    `number` is that of its last piece, `poll` whether it is a status poll.
    """

    number: int
    at_s: float
    mark: str
    text: str
    poll: bool


class Heard:
    """The newest pieces. A line that ends with `poll_line` is a status poll."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        self.poll_line = b""
        self.began_s = now_s()
        self._now_s = now_s
        self._kept: deque[Piece] = deque(maxlen=KEPT)
        self._polls: deque[Piece] = deque(maxlen=POLLS_KEPT)
        self._numbers = itertools.count(1)
        self._target = self._kept

    def tap(self, mark: str, data: bytes) -> None:
        """Take bytes as they pass; returns at once, never raises."""
        if mark == SENT:
            self._target = self._polls if self._polls_with(data) else self._kept
        target = self._target if mark in (SENT, RECEIVED) else self._kept
        target.append(Piece(next(self._numbers), self._now_s(), mark, data))

    def _polls_with(self, data: bytes) -> bool:
        return bool(self.poll_line) and data.rstrip(b"\r").endswith(self.poll_line)

    def newest(self, *, polls: bool) -> int:
        """Return the number of the newest piece, with the status polls or without; 0 before the first."""
        kept = (self._kept, self._polls) if polls else (self._kept,)
        return max((pieces[-1].number for pieces in kept if pieces), default=0)

    def spoken(self, *, polls: bool) -> tuple[Spoken, ...]:
        """Return what went over the link in its order, with the status polls or without."""
        kept = [(piece, False) for piece in _copied(self._kept)]
        if polls:
            kept += [(piece, True) for piece in _copied(self._polls)]
            kept.sort(key=lambda each: each[0].number)
        return tuple(_joined(kept))


def _copied(pieces: deque[Piece]) -> list[Piece]:
    """Return a copy, whatever is appended meanwhile."""
    while True:
        try:
            return list(pieces)
        except RuntimeError:
            continue


def _joined(pieces: list[tuple[Piece, bool]]) -> list[Spoken]:
    """Join pieces of one direction: a line goes out in parts where the link paces it, and comes in as many."""
    found: list[Spoken] = []
    for piece, poll in pieces:
        text = piece.data.decode("latin-1")
        last = found[-1] if found else None
        joins = last is not None and piece.mark in (SENT, RECEIVED) and last.mark == piece.mark
        if last is not None and joins and last.poll == poll and not last.text.endswith(_ENDS[piece.mark]):
            found[-1] = replace(last, number=piece.number, text=last.text + text)
        else:
            found.append(Spoken(number=piece.number, at_s=piece.at_s, mark=piece.mark, text=text, poll=poll))
    return found


_ENDS = {SENT: ("\r",), RECEIVED: ("\x06",)}
