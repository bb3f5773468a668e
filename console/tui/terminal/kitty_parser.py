"""Textual's parser of terminal input, with the event types of kitty's keyboard protocol.

Textual does not ask for event types, and fails at one. They are taken out of a sequence before it is read; what
they say is kept in `event`. An answer to the question for the flags is kept in `flags`, and is no key.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from textual import events
from textual._xterm_parser import XTermParser
from textual.keys import Keys

REPEAT, RELEASE = 2, 3

_TYPED = re.compile(r"(\x1b\[[\d:]*;\d+):([123])((?:;[\d:]*)?[u~A-HPQRS])")
_FLAGS = re.compile(r"\x1b\[\?(\d{1,3})u")


class KittyParser(XTermParser):
    """`event`: of the last key that had one; `flags`: of an answer. Both are for the caller to clear."""

    def __init__(self) -> None:
        super().__init__()
        self.event: int | None = None
        self.flags: int | None = None

    def _sequence_to_key_events(self, sequence: str, alt: bool = False) -> Iterable[events.Key]:
        if typed := _TYPED.fullmatch(sequence):
            self.event = int(typed[2])
            sequence = typed[1] + typed[3]
        elif answer := _FLAGS.fullmatch(sequence):
            self.flags = int(answer[1])
            return (events.Key(Keys.Ignore, sequence),)  # ends the sequence
        return super()._sequence_to_key_events(sequence, alt)
