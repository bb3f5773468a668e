"""Bytes of the link as lines for the recording: routine polls are counted, and there is an upper bound."""

from __future__ import annotations

import re
from collections.abc import Callable

from console.flight.notes import Kind, Note
from drivers.link.tracing import Dialogue, shown

MOST_CHARACTERS = 60_000  # of lines in a segment; a stop or a failure of the link is written in any case

_ASKS = r"(?:#\d+P|F|\?|&\d+\?\?|%|[PMI]\d+)"
_POLL = re.compile(rf"(?:\[\w+\]|.)?(?:#\d+P F \? .*&\d+\?\?|M\d+=\d+ {_ASKS})(?: {_ASKS})*")
"""A status poll, or questions after a renewal of the watchdog; before it perhaps the checksum of another line."""


class LinkLines:
    """Makes notes of bytes; it belongs to the thread of the recorder."""

    def __init__(self, add: Callable[[Note], object]) -> None:
        self._add = add
        self._dialogue = Dialogue(self._line)
        self._polling = False
        self._room = MOST_CHARACTERS
        self._polls = self._left_out = 0

    def heard(self, at_s: float, mark: str, data: bytes) -> None:
        """Take bytes that were sent (`>`), received (`<`) or sent as a stop (`!`), or the code of a failure."""
        if mark in "<>":
            self._dialogue.heard(at_s, mark, data)
        else:
            self._add(Note(at_s=at_s, kind=Kind.LINK, text=f"{mark} {shown(data)}"))

    def begin_segment(self, at_s: float) -> None:
        """Begin to count anew; note what was left out since the last time."""
        if self._polls or self._left_out:
            words = f"polls={self._polls} lines={self._left_out}"
            self._add(Note(at_s=at_s, kind=Kind.LEFT_OUT, text=words))
        self._room, self._polls, self._left_out = MOST_CHARACTERS, 0, 0

    def _line(self, at_s: float, mark: str, words: str) -> None:
        if mark == ">":
            self._polling = _POLL.fullmatch(words) is not None
            self._polls += self._polling
        if self._polling:
            return
        if len(words) > self._room:
            self._left_out += 1
            return
        self._room -= len(words)
        self._add(Note(at_s=at_s, kind=Kind.LINK, text=f"{mark} {words}"))
