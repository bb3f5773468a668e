"""Age of what a terminal sends, and a line that is typed to a question: an order that may be old is no order.

A key has no time of its own: a line that stood still delivers it late. So the terminal is asked for its cursor,
again and again. It answers in the order of its keys: what comes after an answer was typed after that question was
sent. Times are of `drivers.clock.boot_s`, which also counts while the computer is suspended.
"""

from __future__ import annotations

import codecs
import os
import re
import select
import sys
import termios
from dataclasses import dataclass
from itertools import cycle, islice

from drivers.clock import FROZEN_S, OLD_S, boot_s

ASK_S = 0.3  # period of the questions
SLOW_S = 0.5  # round trip beyond which it is said that keys come late
ROW, PLACES = 3, 79
"""Where the cursor is put: in row 1 its report may also be Shift-F3; the column numbers the question."""

_TOKEN = re.compile(r"\x1b\[(?:(\d+);(\d+)R|[\d;?<=>]*[@-~])|\x1b[^\[]|[^\x1b]")
CLOSED = "\x04"
_ERASE, _ERASE_ALL, _END = "\x7f\b", "\x15", f"\r\n{CLOSED}"


class InputAge:
    """Age of what one terminal sends. `round_trip_s` is that of its last answer, None before the first."""

    def __init__(self) -> None:
        self.round_trip_s: float | None = None
        self._emptied_s = boot_s()  # what is read now was typed later
        self._asked: dict[int, float] = {}  # by column, each until its answer: a late one is of no later question
        self._newest_s = self._answered_s = float("-inf")
        self._columns = cycle(range(1, PLACES + 1))

    def question(self, now_s: float) -> tuple[int, str] | None:
        """Return the next question with its column; None while none is due, or all columns wait for answers."""
        if now_s - self._newest_s < ASK_S:
            return None
        free = next((column for column in islice(self._columns, PLACES) if column not in self._asked), None)
        return None if free is None else (free, f"\x1b7\x1b[{ROW};{free}H\x1b[6n\x1b8")

    def note_question(self, column: int, now_s: float) -> None:
        """Note that a question was written."""
        self._asked[column] = self._newest_s = now_s

    def take_cursor_report(self, row: int, column: int, now_s: float) -> bool:
        """Take a report of the cursor; return False if it answers none of these questions."""
        asked_s = self._asked.pop(column, None) if row == ROW else None
        if asked_s is None:
            return False
        self.round_trip_s = now_s - asked_s
        self._answered_s = max(self._answered_s, asked_s)
        return True

    def note_emptied_input(self, began_s: float) -> None:
        """Note that all has been obeyed which was there at this time."""
        self._emptied_s = began_s

    def late_s(self, *, moves: bool = True) -> float | None:
        """Return the greatest age of what was read last, None if it is young enough to be obeyed.

        It is younger than the last moment without unread input and, where the terminal is asked because something
        `moves`, than the last question that it has answered: infinitely old before the first answer.
        """
        unread_s = boot_s() - self._emptied_s
        age_s, most_s = (max(boot_s() - self._answered_s, unread_s), OLD_S) if moves else (unread_s, FROZEN_S)
        return age_s if age_s > most_s else None

    @property
    def is_slow(self) -> bool:
        """Whether the last answer came late."""
        return (self.round_trip_s or 0.0) > SLOW_S


@dataclass(frozen=True, slots=True)
class TypedLine:
    """A line typed to a question, `CLOSED` for the end of the input. `late`: part of it may be old."""

    text: str
    late: bool


def read_line(question: str, terminal: int = 0) -> TypedLine:
    """Ask on stderr, and read the line that is typed at a terminal. What was typed before the question is dropped.

    Raises OSError, termios.error: this is no terminal, or it cannot be written to.
    """
    before, changed = termios.tcgetattr(terminal), termios.tcgetattr(terminal)
    changed[3] &= ~(termios.ICANON | termios.ECHO)
    out = os.open(os.ttyname(terminal), os.O_WRONLY | os.O_NOCTTY)
    try:
        termios.tcsetattr(terminal, termios.TCSAFLUSH, changed)
        print(question, end="", file=sys.stderr, flush=True)
        return _TerminalLine(terminal, out).read()
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
        os.write(out, b"\n")
        os.close(out)


class _TerminalLine:
    """The line at a terminal that neither edits nor echoes."""

    def __init__(self, terminal: int, out: int) -> None:
        self._terminal, self._out = terminal, out
        self._age, self._text, self._late = InputAge(), "", False

    def read(self) -> TypedLine:
        decode, waiting = codecs.getincrementaldecoder("utf-8")("replace").decode, ""
        while True:
            began_s = boot_s()
            if asks := self._age.question(began_s):
                os.write(self._out, asks[1].encode())
                self._age.note_question(asks[0], began_s)
            if select.select([self._terminal], [], [], ASK_S)[0]:
                data = os.read(self._terminal, 4096)
                waiting += decode(data) if data else _END
                while token := _TOKEN.match(waiting):
                    waiting = waiting[token.end() :]
                    if self._take(token):
                        return TypedLine(self._text, self._late)
            self._age.note_emptied_input(began_s)

    def _take(self, token: re.Match[str]) -> bool:
        """Take a character or an answer; return whether the line has ended."""
        said = token[0]
        if token[1]:
            self._age.take_cursor_report(int(token[1]), int(token[2]), boot_s())
            return False
        self._late |= self._age.late_s() is not None
        erased = {_ERASE_ALL: len(self._text)}.get(said, int(said in _ERASE and bool(self._text)))
        if erased:
            self._text = self._text[:-erased]
            os.write(self._out, b"\b \b" * erased)
        elif said == CLOSED:
            self._text = self._text or CLOSED
        elif said.isprintable():
            self._text += said
            os.write(self._out, said.encode())
        return said in _END
