"""The thread that reads the terminal stops the machine itself: a stop never waits for the screen.

A key goes from here into the queue of the application, which may be busy painting, or stuck because the
terminal takes nothing. A stop key is acted on before that.
"""

from __future__ import annotations

import os
import select
import signal
import time
from codecs import getincrementaldecoder
from typing import Any, Protocol, cast

from textual import events
from textual._xterm_parser import XTermParser
from textual.app import App
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message

from console.tui.gate import FieldKind, stops_at_once
from console.tui.keymap import KILL_KEYS, STOP_KEYS

WAIT_S = 0.1
"""How long the reading thread waits for a key before it looks whether it is to end."""

CHUNK = 4096

PASTE_BEGINS, PASTE_ENDS = "\x1b[200~", "\x1b[201~"
PASTE_SILENCE_S = 0.5
"""How long nothing may come in the middle of a paste."""

UNREADABLE = "unreadable"
"""The key of whatever the terminal said that is no key: bound to nothing, so that it stops what moves."""


class StopSent(Message):
    """A stop key was pressed and has been acted on."""


class StopTarget(Protocol):
    """What the driver needs of the application; plain attributes, so that reading them waits for nothing."""

    field_kind: FieldKind

    def stop_now(self, key: str) -> None:
        """Stop the machine."""

    def kill_now(self, key: str) -> None:
        """Open every loop."""


class StopDriver(LinuxDriver):
    """The terminal as Textual drives it, with the stop keys taken out first."""

    def __init__(
        self, app: App[Any], *, debug: bool = False, mouse: bool = True, size: tuple[int, int] | None = None
    ) -> None:
        super().__init__(app, debug=debug, mouse=mouse, size=size)
        # A console that sleeps stops nothing. And Textual answers each SIGCONT, which a hang-up brings along,
        # with one more thread that reads the same terminal.
        for number in (signal.SIGTSTP, signal.SIGCONT):
            signal.signal(number, signal.SIG_IGN)

    def process_message(self, message: Message) -> None:
        """Act on a stop key here, in the thread that read it; pass everything else on."""
        if isinstance(message, events.Key):
            target = cast(StopTarget, self._app)
            if stops_at_once(message.key, target.field_kind):
                target.stop_now(message.key)
                message = StopSent()
            elif message.key in KILL_KEYS:
                target.kill_now(message.key)
                message = StopSent()
        super().process_message(message)

    def run_input_thread(self) -> None:
        """Read keys until the screen is left. Nothing that a terminal can say ends it but the terminal's own end.

        Textual's own would end with the first key release, or the first byte that is no UTF-8.
        """
        reader = Reader()
        decode = getincrementaldecoder("utf-8")("replace").decode
        while not self.exit_event.is_set():
            said: list[Message] = []
            if select.select([self.fileno], [], [], WAIT_S)[0]:
                data = _read(self.fileno)
                if not data:
                    # Whoever has no controlling terminal is not told by the kernel.
                    os.kill(os.getpid(), signal.SIGHUP)
                    return
                for character in decode(data):
                    said += reader.read(character, time.monotonic())
            for message in (*said, *reader.idle(time.monotonic())):
                self.process_message(message)


class Reader:
    """Textual's parser, kept from failing and from making keys of what is none.

    A paste is no key press either. It is told when it begins, because from there on the parser keeps every key
    to itself; one whose end was lost on the way is given up when nothing more comes.
    """

    def __init__(self) -> None:
        self._parser = XTermParser()
        self._last = ""
        self._pasting = False
        self._heard_s = 0.0

    def read(self, character: str, now_s: float) -> list[Message]:
        """Take in one character; return what was said by it. `now_s` is of any clock that only goes forward."""
        self._last, self._heard_s = (self._last + character)[-len(PASTE_BEGINS) :], now_s
        try:
            said = list(self._parser.feed(character))
        except Exception:
            return self._begun_anew()
        if self._last == PASTE_BEGINS:
            self._pasting = True
            said.append(_unreadable())
        elif self._last == PASTE_ENDS:
            self._pasting = False
        # An escape sequence that is given up for the next comes with a caret in the place of its Escape.
        given_up = bool(said) and isinstance(said[0], events.Key) and said[0].character == "^"
        return _whole(said) if given_up else said

    def idle(self, now_s: float) -> list[Message]:
        """Return what is said by nothing more coming: an Escape alone, or a sequence that nobody knows."""
        if self._pasting and now_s - self._heard_s > PASTE_SILENCE_S:
            return self._begun_anew()
        return _whole(list(self._parser.tick()))

    def _begun_anew(self) -> list[Message]:
        self._parser, self._pasting = XTermParser(), False
        return [_unreadable()]


def _whole(said: list[Message]) -> list[Message]:
    """Undo the taking apart of a sequence into keys that nobody pressed; only a stop among them stays."""
    if len(said) < 2:
        return said
    stops: list[Message] = [key for key in said if isinstance(key, events.Key) and key.key in STOP_KEYS]
    return stops or [_unreadable()]


def _unreadable() -> events.Key:
    return events.Key(UNREADABLE, None)


def _read(terminal: int) -> bytes:
    """Return what was typed, nothing when the terminal is gone."""
    try:
        return os.read(terminal, CHUNK)
    except OSError:
        return b""
