"""Textual's parser of terminal input, with what it lacks: event types, answers of the terminal, function keys.

Textual does not ask for event types of kitty's keyboard protocol, and fails at one. They are taken out of a
sequence before it is read; what they say is kept in `event`. An answer of the terminal is no key, whoever asked: a
line may bring it late, and tmux passes on what it has no use for.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from textual import constants, events
from textual._xterm_parser import XTermParser
from textual.keys import Keys
from textual.message import Message

from console.tui.gate import UNCONFIRMED, UNREADABLE

REPEAT, RELEASE = 2, 3
ANSWER_S = 1.0  # time from the beginning of an answer to its end; later it is invalid input

_TYPED = re.compile(r"(\x1b\[[\d:]*;\d+):([123])((?:;[\d:]*)?[u~A-HPQRS])")

# How an answer begins, and no key: from there on it may take its time. Only the name of a terminal has spaces.
_BEGUN = re.compile(r"\x1b(?:\[[?>]|\]\d|P[\d>!]|_G)")
_UNFINISHED = re.compile(r"\x1b(?:\[[?>][\d;:]{0,99}\$?|(?:P>\|[ -~]{0,99}|[\]P_][!-~]{0,400})\x1b?)")
_ANSWER = re.compile(r"\x1b(?:\[[?>][\d;:]*(?:[cnRSmu]|\$y)|[\]P_].*(?:\x07|\x1b\\))")
_SHORT_ANSWER = re.compile(r"\x1b\[\d[\d;]*(?:[cntx]|\$y)")
_FLAGS = re.compile(r"\x1b\[\?(\d{1,3})u")
_CURSOR = re.compile(r"\x1b\[\?(\d+;\d+)(?:;\d*)?R")
_PUTTY = "\x1b[>0;136;0c"

_VT100_PLUS = {f"\x1bO{final}": f"f{number}" for number, final in enumerate("TUVWXYZ[", start=5)}
_SCO = re.compile(r"\x1b\[[P-S]")  # F4 to F7 there, F1 to F4 in kitty's protocol
_OWN_FORM = re.compile(r"\x1b\[(?:1[1-4]~|\[[A-D])")  # of F1 to F4, so that the next is the keypad's
_OF_KEYPAD = re.compile(r"\x1bO[P-S]")


class FunctionKeys:
    """Function keys of a terminal that may be set to send one key for another, as PuTTY.

    `kitty`: it speaks that protocol. `putty`: it is asked for F1 before the keypad could be taken for F2 to F4.
    """

    def __init__(self) -> None:
        self.kitty = self.putty = False
        self._asked = self._confirmed = self._has_own_form = False

    def judge(self, sequence: str, keys: tuple[events.Key, ...]) -> tuple[events.Key, ...]:
        """Return the keys of a whole sequence, or an unbound one where another may have been pressed."""
        asked, self._asked = self._asked, False
        self._has_own_form |= _OWN_FORM.fullmatch(sequence) is not None
        from_keypad, is_f1 = _OF_KEYPAD.fullmatch(sequence) is not None, sequence == "\x1bOP"
        self._confirmed |= asked and is_f1
        ignored = keys[0].key == Keys.Ignore  # by Textual, as the 5 of some keypads
        if ignored or (_SCO.fullmatch(sequence) and not self.kitty) or (from_keypad and self._has_own_form):
            return (events.Key(UNREADABLE, None),)
        self._asked = from_keypad and self.putty and not (is_f1 or self._confirmed)
        return (events.Key(UNCONFIRMED, None),) if self._asked else keys


class KittyParser(XTermParser):
    """`event`: of the last key that had one; `flags`, `cursor` (row, column): of an answer. All are to be cleared.

    `now_s` is the caller's clock, set before each call.
    """

    def __init__(self, functions: FunctionKeys | None = None) -> None:
        super().__init__()
        self.event: int | None = None
        self.flags: int | None = None
        self.cursor: tuple[int, int] | None = None
        self.now_s = self._begun_s = self._heard_s = 0.0
        self._functions = functions or FunctionKeys()
        self._answer, self._passes_on = "", False

    def feed(self, data: str) -> Iterable[Message]:
        """Take in characters; return the resulting events, among them each report of the cursor."""
        for character in data:
            for each in self._continue(character) if self._answer else super().feed(character):
                if not isinstance(each, events.CursorPosition):
                    yield each
                elif each.y == 0 and not self._passes_on:  # F3 with modifiers: our own questions avoid row 1
                    yield from super()._sequence_to_key_events(f"\x1b[1;{each.x + 1}R")
                else:
                    self.cursor = each.y + 1, each.x + 1
                    yield each

    def tick(self) -> Iterable[Message]:
        """Return the events due without more input; an answer without an end is invalid input."""
        if self._answer and self._is_over(self._answer[-1] == "\x1b"):
            yield from self._give_up("")
        yield from super().tick()

    def _continue(self, character: str) -> Iterable[Message]:
        """Add a character to an answer; a Space after a pause is pressed."""
        answer, is_over = self._answer + character, self._is_over(character == " ")
        self._heard_s = self.now_s
        if not is_over and _ANSWER.fullmatch(answer):
            self._answer = ""
            yield from self._take(answer)
        elif not is_over and _UNFINISHED.fullmatch(answer):
            self._answer = answer
        else:
            yield from self._give_up(character)

    def _is_over(self, pressed: bool) -> bool:
        paused = pressed and self.now_s - self._heard_s > constants.ESCAPE_DELAY
        return paused or self.now_s - self._begun_s > ANSWER_S

    def _take(self, answer: str) -> Iterable[Message]:
        if flags := _FLAGS.fullmatch(answer):
            self.flags = int(flags[1])
        elif answer.endswith(("$y", "R")):  # a mode that Textual has asked for; the cursor, without the page
            self._passes_on = True
            yield from super().feed(_CURSOR.sub("\x1b[\\1R", answer))
            self._passes_on = False
        self._functions.putty |= answer == _PUTTY

    def _give_up(self, character: str) -> Iterable[Message]:
        rest = "\x1b" * self._answer.endswith("\x1b") + character
        self._answer = ""
        yield events.Key(UNREADABLE, None)
        yield from super().feed(rest) if rest else ()

    def _sequence_to_key_events(self, sequence: str, alt: bool = False) -> Iterable[events.Key]:
        if typed := _TYPED.fullmatch(sequence):
            self.event = int(typed[2])
            sequence = typed[1] + typed[3]
        ends_here = (events.Key(Keys.Ignore, sequence),)
        if _BEGUN.fullmatch(sequence) and not self._passes_on:
            self._answer = sequence
            self._begun_s = self._heard_s = self.now_s
            return ends_here
        if sequence in _VT100_PLUS:
            return (events.Key(_VT100_PLUS[sequence], None),)
        keys = tuple(super()._sequence_to_key_events(sequence, alt))
        if not keys:
            return ends_here if _SHORT_ANSWER.fullmatch(sequence) else ()
        return self._functions.judge(sequence, keys)
