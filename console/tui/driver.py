"""Terminal thread: it stops the machine itself, so that a stop never waits for the screen.

A key goes from here into the queue of the application, which may be busy painting, or blocked by the
terminal. A stop key is acted on before that. Any other action is passed on once it is known that it
came alone, as from a person: see `pace.py`.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from codecs import getincrementaldecoder
from contextlib import suppress
from queue import Full
from typing import Any, Protocol, cast

from textual import constants, events
from textual.app import App
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message

from console.session.dated_input import InputAge
from console.tui import gate
from console.tui.application.key_releases import KeyReleases, ReportedKey, Stroke
from console.tui.application.kitty_parser import RELEASE, REPEAT, FunctionKeys, KittyParser
from console.tui.keymap import KILL_KEYS, MOTION_PAGES, STOP_KEYS, Action, PageName
from console.tui.pace import QUIET_S, KeyPace, Scan, ScanCollector
from drivers.clock import boot_s

WAIT_S = 0.1  # time that the reading thread waits for a key before it checks whether to end
CHUNK = 4096

MOUSE_ON, MOUSE_OFF = "\x1b[?1000h\x1b[?1006h", "\x1b[?1006l\x1b[?1000l"
PASTE_BEGINS, PASTE_ENDS = "\x1b[200~", "\x1b[201~"
PASTE_SILENCE_S = 0.5  # timeout within a paste

AMBIGUOUS, MEASURED_ROW = "─±…▶", 2  # signs of one cell, or of two where a terminal shows them as wide as Hangul
IDENTIFY = "\x1b>\x1b[>c"  # digits from the keypad, not function keys; and the kind of the terminal
MEASURE = f"\x1b7\x1b[{MEASURED_ROW};1H{AMBIGUOUS}\x1b[6n\x1b8"  # where the cursor is behind the signs


class StopSent(Message):
    """A stop key was acted on; `action` is the other meaning of the key, when something moved."""

    def __init__(self, action: Action | None) -> None:
        super().__init__()
        self.action = action


class TooFast(Message):
    """Keys came faster than a person types; they only stopped (`stopped`) or wrote into a field (`written`)."""

    def __init__(self, *, written: bool, stopped: bool) -> None:
        super().__init__()
        self.written, self.stopped = written, stopped


class Late(Message):
    """Input that may be older than it may be was dropped, all but stops; `age_s` is its greatest age."""

    def __init__(self, age_s: float) -> None:
        super().__init__()
        self.age_s = age_s


class KeyFault(Message):
    """An internal fault in the reading of a message; the thread that reads continues."""

    def __init__(self, error: Exception) -> None:
        super().__init__()
        self.error = error


class WideSigns(Message):
    """The terminal shows signs in two cells that have one on the pages."""


class Scanned(Message):
    """What keys that came too fast were, once all of them are there."""

    def __init__(self, scan: Scan) -> None:
        super().__init__()
        self.scan = scan


class Written(events.Key):
    """A key of a field, not held back: it may write, or stop (`stopped`: sent already), and nothing else."""

    def __init__(self, key: str, character: str | None, *, stopped: bool = False) -> None:
        super().__init__(key, character)
        self.stopped = stopped


Written.handler_name = events.Key.handler_name  # so that key handlers receive it


class StopTarget(Protocol):
    """Interface of the driver to the application; nothing of it blocks, whatever the application does."""

    def situation(self) -> gate.KeySituation:
        """Return what a key is judged by now."""

    def stop_now(self, reason: str) -> None:
        """Stop the machine."""

    def kill_now(self, reason: str) -> None:
        """Open every loop."""


class StopDriver(LinuxDriver):
    """Textual's terminal driver, which handles stop keys first."""

    def __init__(self, app: App[Any], **options: Any) -> None:
        super().__init__(app, **options)
        self._pace: KeyPace[events.Key] = KeyPace()
        self._codes = ScanCollector()
        self._stopped_s = float("-inf")
        self._reports_mouse = self._drops = self._keyed = False
        self.releases, self.age = KeyReleases(), InputAge()
        # A suspended console cannot stop anything. And Textual answers each SIGCONT, which comes with a hang-up,
        # with one more thread that reads the same terminal.
        for number in (signal.SIGTSTP, signal.SIGCONT):
            signal.signal(number, signal.SIG_IGN)

    def process_message(self, message: Message) -> None:
        """Act on a stop key in the thread that read it; hold an action back, and pass everything else on.

        Nothing that fails here ends this thread: the next key may be a stop.
        """
        try:
            if isinstance(message, events.Key) and not gate.is_inert(message.key):
                self._hear(message, time.monotonic())
            elif isinstance(message, events.CursorPosition):
                self.age.take_cursor_report(message.y + 1, message.x + 1, boot_s())
                if message.y + 1 == MEASURED_ROW and message.x > len(AMBIGUOUS):
                    super().process_message(WideSigns())
            elif not isinstance(message, events.MouseEvent) or self._late_s(self._situation()) is None:
                super().process_message(message)
        except Exception as error:
            with suppress(Exception):
                super().process_message(KeyFault(error))

    def start_application_mode(self) -> None:
        """Take the terminal, and ask it once what it is, before anything is painted over that."""
        super().start_application_mode()  # type: ignore[no-untyped-call]
        asked = "" if constants.DISABLE_KITTY_KEY else self.releases.ask(True, time.monotonic())
        self.write(IDENTIFY + MEASURE + asked)
        self.flush()

    def run_input_thread(self) -> None:
        """Read keys until the screen is left; a key release or invalid UTF-8 would end Textual's own loop."""
        reader = Reader(self.releases)
        decode = getincrementaldecoder(terminal_encoding())("replace").decode
        while not self.exit_event.is_set():
            if not reader.pasting:  # an answer would go on with a paste whose end was lost
                self._ask()
            wait_s, began_s = self._pace.wait_s(time.monotonic(), WAIT_S), boot_s()
            ready = bool(select.select([self.fileno], [], [], wait_s)[0])
            data = _read(self.fileno) if ready else b""
            if ready and not data:
                # Without a controlling terminal the kernel sends no notification.
                os.kill(os.getpid(), signal.SIGHUP)
                return
            # Half a character that nothing follows is a key by itself, and must not come with the next one.
            for character in decode(data, not ready):
                for message in reader.read(character, time.monotonic()):
                    self.process_message(message)
            for message in reader.idle(time.monotonic()):
                self.process_message(message)
            if len(data) < CHUNK:
                self.age.note_emptied_input(began_s)
            # After all pending input: a delayed thread must not take a key of a burst for a single one.
            for key in self._pace.take_due_keys(time.monotonic()):
                super().process_message(key)
            self._tell(self._codes.take_due_scan(time.monotonic()))

    def _ask(self) -> None:
        """Ask the terminal how late its keys are, where keys move something, and after a key that may lead there.

        It is not waited for: a stalled one takes no question.
        """
        after_key, self._keyed = self._keyed, False
        if self._writer_thread is None or not (after_key or self._situation().page in MOTION_PAGES):
            return
        if asks := self.age.question(boot_s()):
            with suppress(Full):
                self._writer_thread._queue.put_nowait(asks[1])  # noqa: SLF001 - `write` would wait, and hold up a stop
                self.age.note_question(asks[0], boot_s())

    def _late_s(self, now: gate.KeySituation) -> float | None:
        return self.age.late_s(moves=now.page in MOTION_PAGES)

    def _situation(self) -> gate.KeySituation:
        """Return what a key is judged by; in doubt, motion: this thread continues, and every key stops."""
        try:
            return cast(StopTarget, self._app).situation()
        except Exception:
            return gate.KeySituation(page=PageName.JOBS, moving=True)

    def report_mouse(self, on: bool) -> None:
        """Ask the terminal for clicks and the wheel (1000), in decimals (1006); or for nothing any more.

        Not for motion (1002, 1003): a drag would send a report for each cell.
        """
        if on is not self._reports_mouse:
            self._reports_mouse = on
            self.write(MOUSE_ON if on else MOUSE_OFF)
            self.flush()

    def report_releases(self, on: bool) -> None:
        """Have the terminal report releases of keys, if it can, or not any more; to be called at every tick."""
        said = self.releases.ask(on and not constants.DISABLE_KITTY_KEY, time.monotonic())
        if said:
            self.write(said)
            self.flush()

    def disable_input(self) -> None:
        """Stop reading; the terminal is left without reports of the mouse and of releases."""
        self.report_mouse(False)
        self.report_releases(False)
        super().disable_input()

    def _hear(self, key: events.Key, now_s: float) -> None:
        self._keyed = True
        try:
            now = cast(StopTarget, self._app).situation()
            verdict, action = gate.judge(key.key, key.character, now)
        except Exception:  # in doubt assume motion: this thread continues, and every key stops, whatever it means
            now, kills = gate.KeySituation(page=PageName.JOBS, moving=True), key.key in KILL_KEYS
            verdict, action = (gate.KeyDecision.KILL if kills else gate.KeyDecision.STOP), None
        if verdict in (gate.KeyDecision.STOP, gate.KeyDecision.KILL):  # before anything else that may fail
            target = cast(StopTarget, self._app)
            send = target.kill_now if verdict is gate.KeyDecision.KILL else target.stop_now
            send(gate.stop_reason(key.key, key.character, action))
        written, late_s = now.field is not gate.FieldKind.NONE, self._late_s(now)
        # Of what waited, a field takes what comes before the first dropped key: the rest may be of another.
        writes = verdict is gate.KeyDecision.FIELD or gate.is_stray(key.key, key.character, now)
        self._drops = late_s is not None and (self._drops or not writes)
        if verdict in (gate.KeyDecision.STOP, gate.KeyDecision.KILL):
            burst = self._pass_stop_on(key, now_s, now, action)
        elif self._drops and late_s is not None:
            super().process_message(Late(late_s))
            return
        elif writes:
            # A scanner may write, but its input must be read before it is accepted.
            character = key.character is not None and key.character.isprintable()
            burst = self._pace.write(key.key, now_s, character=character)
            super().process_message(Written(key.key, key.character))
        else:
            burst = self._pace.hold(key.key, key, now_s)
        stopped = now_s - self._stopped_s <= QUIET_S
        if burst:
            super().process_message(TooFast(written=written, stopped=stopped))
        code = self._codes.hear(
            key.key, key.character, now_s, burst=burst, written=written, stopped=stopped and burst
        )
        self._tell(code)

    def _pass_stop_on(self, key: events.Key, now_s: float, now: gate.KeySituation, action: Action | None) -> bool:
        """Tell the application of a stop that was sent; return whether its key belongs to a burst."""
        self._stopped_s = now_s
        burst = self._pace.hear(key.key, now_s)
        super().process_message(StopSent(action))
        if gate.is_stray(key.key, key.character, now):
            super().process_message(Written(key.key, key.character, stopped=True))
        if action is not None and gate.is_page(action) and not burst and not self._drops:
            self._pace.hold(key.key, key, now_s)  # after the stop, the action is harmless
        return burst

    def _tell(self, code: Scan | None) -> None:
        if code is not None:
            super().process_message(Scanned(code))


class Reader:
    """Textual's parser, made robust against invalid input, which must not become keys.

    A paste is no key press either. Its beginning is reported, because from there on the parser collects every key;
    a paste whose end was lost is given up after a timeout. The release of a key is counted in `releases` and is no
    key; in a terminal that has not said that it reports any, it is invalid input.
    """

    def __init__(self, releases: KeyReleases | None = None) -> None:
        self._releases = releases or KeyReleases()
        self._functions = FunctionKeys()
        self._parser = KittyParser(self._functions)
        self._last = ""
        self.pasting = False
        self._heard_s = 0.0

    def read(self, character: str, now_s: float) -> list[Message]:
        """Take in one character; return the resulting events. `now_s` is of any monotonic clock."""
        self._last, self._heard_s = (self._last + character)[-len(PASTE_BEGINS) :], now_s
        self._parser.now_s, self._functions.kitty = now_s, self._releases.understood
        try:
            said = list(self._parser.feed(character))
        except Exception:
            return self._begun_anew()
        if self._last == PASTE_BEGINS:
            self.pasting = True
            said.append(events.Key(gate.PASTED, None))
        elif self._last == PASTE_ENDS:
            self.pasting = False
        if self._parser.event is not None or self._parser.flags is not None or self._releases.confirmed:
            said = self._add_reports(said, now_s)
        # An escape sequence abandoned for the next arrives with a caret in place of its Escape.
        given_up = bool(said) and isinstance(said[0], events.Key) and said[0].character == "^"
        return _rejoin_keys(said) if given_up else said

    def idle(self, now_s: float) -> list[Message]:
        """Return the events due without more input: an Escape alone, or an unknown sequence."""
        if self.pasting and now_s - self._heard_s > PASTE_SILENCE_S:
            return self._begun_anew()
        self._parser.now_s = now_s
        return _rejoin_keys(list(self._parser.tick()))

    def _add_reports(self, said: list[Message], now_s: float) -> list[Message]:
        """Add to keys what the terminal says of them; a release and an answer to a question are none."""
        event, flags = self._parser.event, self._parser.flags
        self._parser.event = self._parser.flags = None
        if flags is not None:
            self._releases.take_answer(flags, now_s)  # or an answer that another program has asked for
            return []
        inert = all(isinstance(each, events.Key) and gate.is_inert(each.key) for each in said)
        if event is not None and not self._releases.understood and not inert:
            return [events.Key(gate.UNREADABLE, None)]
        if event == RELEASE:
            self._releases.count += 1
            return []
        # A press has no event type.
        stroke = Stroke(repeated=event == REPEAT, releases=self._releases.count)
        return [
            ReportedKey(each.key, each.character, stroke) if isinstance(each, events.Key) else each
            for each in said
        ]

    def _begun_anew(self) -> list[Message]:
        self._parser, self.pasting = KittyParser(self._functions), False
        return [events.Key(gate.UNREADABLE, None)]


def _rejoin_keys(said: list[Message]) -> list[Message]:
    """Undo the split of a sequence into keys that nobody pressed; keep only a stop among them."""
    if len(said) < 2:
        return said
    stops: list[Message] = [key for key in said if isinstance(key, events.Key) and key.key in STOP_KEYS]
    return stops or [events.Key(gate.UNREADABLE, None)]


def terminal_encoding() -> str:
    """Return the encoding of what is typed: that of the locale."""
    return getattr(sys.__stdin__, "encoding", None) or "utf-8"


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, CHUNK)
    except OSError:
        return b""
