"""Keys by what terminals send for them: all of kitty's protocol in a cut, and function keys as PuTTY does."""

from __future__ import annotations

import os
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from textual import constants, events
from textual._keyboard_protocol import FUNCTIONAL_KEYS
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message

from console.flight.notes import Inbox
from console.flight.recorded_control import RecordedControl
from console.session.station.link.opening import OpenMachine
from console.session.station.link_thread import LinkThread
from console.session.station.state import StationState
from console.text.catalogue import load
from console.tui import driver
from console.tui.application.key_releases import KeyReleases
from console.tui.application.listening import ListeningApp
from console.tui.application.logged_control import LoggedControl
from console.tui.driver import Reader, StopDriver
from console.tui.gate import UNCONFIRMED, UNREADABLE, KeyDecision, KeySituation, judge, stop_reason
from console.tui.keymap import PageName
from console.tui.pace import KeyPace, ScanCollector
from console.tui.theme import MONO
from console.tui.ui_context import UiContext
from drivers.lathe.stop import StopPath
from drivers.link.passing import RenewableLink, TappedLink
from drivers.link.tracing import TracedLink
from profiles.store import load_machine
from tests.console.consoles import MACHINE
from tests.drivers.test_recovery import Wire
from tests.tui.stage import answered_age
from tests.tui.test_terminal_answers import ANSWERS

CUTTING = KeySituation(page=PageName.RUN, moving=True)

# The table of functional keys of the protocol, by its numbers: locks and Print Screen, media keys, modifiers.
MEANINGLESS = {*range(57358, 57362), *range(57428, 57455)}

# The manual of PuTTY, "Changing the action of the function keys and keypad".
TILDE = [f"\x1b[{n}~" for n in (11, 12, 13, 14, 15, 17, 18, 19, 20, 21, 23, 24)]
SS3 = [f"\x1bO{final}" for final in "PQRSTUVWXYZ["]
PUTTY = {
    "ESC[n~": TILDE,
    "Linux": [*(f"\x1b[[{final}" for final in "ABCDE"), *TILDE[5:]],
    "Xterm R6": [*SS3[:4], *TILDE[4:]],
    "VT400": TILDE,
    "VT100+": SS3,
    "SCO": [f"\x1b[{final}" for final in "MNOPQRSTUVWX"],
}
VT400_KEYPAD = SS3[:4]
IS_PUTTY = "\x1b[>0;136;0c"


def keys_of(reader: Reader, typed: str, now_s: float = 0.0) -> list[events.Key]:
    said = [message for character in typed for message in reader.read(character, now_s)]
    return [each for each in said if isinstance(each, events.Key)]


def named(reader: Reader, typed: str) -> str:
    """The name of a key that is pressed alone, a moment before the next one; "" for none (F3 of SCO: a blur)."""
    said = [*keys_of(reader, typed), *reader.idle(0.0)]
    return "".join(each.key for each in said if isinstance(each, events.Key))


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A key that is the beginning of a sequence need not be waited for."""
    monkeypatch.setattr(constants, "ESCAPE_DELAY", 0.0)


@pytest.mark.parametrize("code", FUNCTIONAL_KEYS)
@pytest.mark.parametrize("modifiers", [1, 2, 3, 5, 9, 65, 129])
def test_in_a_cut_each_key_of_the_protocol_stops_or_has_a_meaning_but_those_without_any(
    code: str, modifiers: int
) -> None:
    number, final = code[:-1], code[-1]
    meaningless = int(number) in MEANINGLESS
    releases = KeyReleases()
    releases.ask(True, 0.0)
    for answers in (False, True):  # whether this terminal has said that it speaks the protocol
        reader = Reader(releases)
        if answers:
            keys_of(reader, "\x1b[?27u")
        for stroke in ("", ":1", ":2"):
            (key,) = keys_of(reader, f"\x1b[{number};{modifiers}{stroke}{final}")
            verdict, _ = judge(key.key, key.character, CUTTING)
            assert (verdict is KeyDecision.NOTHING) is meaningless, key.key
        released = [key.key for key in keys_of(reader, f"\x1b[{number};{modifiers}:3{final}")]
        assert released == ([] if answers or meaningless else [UNREADABLE])
    if modifiers == 1:
        (key,) = keys_of(reader, f"\x1b[{number}{final}" if number != "1" else f"\x1b[{final}")
        assert (judge(key.key, None, CUTTING)[0] is KeyDecision.NOTHING) is meaningless


class Cutting(StopDriver):
    """The thread that reads keys, in a cut; it is the application as well."""

    def __init__(self) -> None:
        self._pace, self._codes, self._stopped_s = KeyPace(), ScanCollector(), float("-inf")
        self.age, self._drops = answered_age(), False
        self._app, self.stops = self, list[str]()  # type: ignore[assignment]

    def situation(self) -> KeySituation:
        return CUTTING

    def stop_now(self, reason: str) -> None:
        self.stops.append(reason)

    kill_now = stop_now


def stops_of(typed: list[str], monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Why the machine was stopped, in a terminal that reports releases."""
    monkeypatch.setattr(LinuxDriver, "process_message", lambda driver, message: None)
    releases = KeyReleases()
    releases.ask(True, 0.0)
    cutting, reader = Cutting(), Reader(releases)
    for sequence in ("\x1b[?27u", *typed):
        for character in sequence:
            for message in reader.read(character, 0.0):
                cutting.process_message(message)
        for message in reader.idle(0.0):
            cutting.process_message(message)
    return cutting.stops


def test_a_hand_on_ctrl_or_print_screen_ends_no_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    strokes = [f"\x1b[{code};{state}u" for code in sorted(MEANINGLESS) for state in ("1", "5:2", "5:3")]
    assert stops_of([*strokes, "\x1b[57442u", *ANSWERS.values()], monkeypatch) == []
    # Pause, Menu, the middle of the keypad, Shift-F3, Ctrl with a letter.
    unassigned = ["\x1b[57362u", "\x1b[57363u", "\x1b[E", "\x1b[57427~", "\x1b[13;2~", "\x1b[1;2R", "\x1b[120;5u"]
    assert len(stops_of(unassigned, monkeypatch)) == len(unassigned)


@pytest.mark.parametrize("setting", PUTTY)
@pytest.mark.parametrize("seen", [(), (4, 5, 6), (1, 4), tuple(range(1, 13))])
@pytest.mark.parametrize("who", [IS_PUTTY, ""])
def test_no_function_key_is_taken_for_another_one(setting: str, seen: tuple[int, ...], who: str) -> None:
    reader = Reader()
    keys_of(reader, who)
    for number in (*seen, *range(1, 13)):
        sent = PUTTY[setting][number - 1]
        assert named(reader, sent) in (f"f{number}", UNREADABLE, UNCONFIRMED, ""), (setting, number)


@pytest.mark.parametrize("setting", [name for name in PUTTY if name != "SCO"])
def test_function_keys_are_read_once_f1_was_pressed_when_it_was_asked_for(setting: str) -> None:
    reader = Reader()
    keys_of(reader, IS_PUTTY)
    first = named(reader, PUTTY[setting][3])
    assert first == ("f4" if setting in ("ESC[n~", "Linux", "VT400") else UNCONFIRMED)
    assert named(reader, PUTTY[setting][0]) == "f1"
    assert [named(reader, sent) for sent in PUTTY[setting]] == [f"f{number}" for number in range(1, 13)]


def test_the_keypad_of_a_vt400_never_becomes_a_function_key_that_moves() -> None:
    reader = Reader()
    keys_of(reader, IS_PUTTY)
    num_lock, divide, multiply, minus = VT400_KEYPAD
    # Num Lock is pressed before it is asked for F1, Minus twice, and Num Lock again after another key.
    pressed = [num_lock, minus, minus, multiply, divide, "5", num_lock, minus]
    assert {named(reader, sent) for sent in pressed} <= {"f1", "5", UNCONFIRMED}
    assert named(reader, TILDE[3]) == "f4"
    assert [named(reader, sent) for sent in VT400_KEYPAD] == [UNREADABLE] * 4


def test_what_may_be_another_key_stops_what_moves() -> None:
    for key in (UNREADABLE, UNCONFIRMED):
        assert judge(key, None, CUTTING) == (KeyDecision.STOP, None)
        assert stop_reason(key, None, None) == UNREADABLE
        assert judge(key, None, KeySituation(page=PageName.RUN))[0] is KeyDecision.NOTHING


def test_f1_to_f4_are_kitty_s_only_where_the_terminal_speaks_its_protocol() -> None:
    releases = KeyReleases()
    reader = Reader(releases)
    assert [named(reader, f"\x1b[{final}") for final in "PQS"] == [UNREADABLE] * 3
    releases.ask(True, 0.0)
    keys_of(reader, "\x1b[?25u")
    assert [named(reader, f"\x1b[{final}") for final in "PQS"] == ["f1", "f2", "f4"]


class Listening(StopDriver):
    """A driver at a pipe: types the next piece when what came before has become the awaited number of keys."""

    def __init__(self, pieces: list[tuple[bytes, int]]) -> None:
        self.fileno, self._writes = os.pipe()
        self._pieces, self.heard, self.exit_event = pieces, list[str](), threading.Event()
        self._pace, self._codes, self.releases = KeyPace(), ScanCollector(), KeyReleases()
        self.age, self._keyed, self._writer_thread = answered_age(), False, None
        os.write(self._writes, pieces[0][0])

    def process_message(self, message: Message) -> None:
        assert isinstance(message, events.Key)
        self.heard.append(message.character or message.key)
        if len(self.heard) == sum(count for _, count in self._pieces):
            self.exit_event.set()
        elif len(self.heard) == self._pieces[0][1]:
            os.write(self._writes, self._pieces[1][0])


@pytest.mark.parametrize(
    ("encoding", "jamo", "read"),
    [
        ("euc_kr", b"\xa4\xcb", ["ㅛ"]),  # KS X 1001, row 4: A4 A1 is the first jamo
        ("euc_kr", "가".encode("euc_kr"), ["가"]),
        ("utf-8", "ㅛ".encode(), ["ㅛ"]),
        ("utf-8", b"\xa4\xcb", ["\ufffd", "\ufffd"]),  # the terminal is set to another encoding than the locale
    ],
)
def test_a_jamo_in_any_encoding_leaves_the_next_key_alone(
    encoding: str, jamo: bytes, read: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(driver, "terminal_encoding", lambda: encoding)
    heard = Listening([(jamo, len(read)), (b"\x1b[15~", 1)])
    late = threading.Timer(5.0, heard.exit_event.set)
    late.start()
    heard.run_input_thread()
    late.cancel()
    assert heard.heard == [*read, "f5"]


def test_the_encoding_of_the_terminal_is_that_of_the_locale(monkeypatch: pytest.MonkeyPatch) -> None:
    class Input:
        encoding = "euc_kr"

    def is_read_as(given: Any) -> str:
        monkeypatch.setattr("sys.__stdin__", given)
        return driver.terminal_encoding()

    assert (is_read_as(Input()), is_read_as(None)) == ("euc_kr", "utf-8")


# From a stop key to its byte: the byte goes first, by a short way, and nothing that takes notes can hinder it.


MOST_FRAMES = 11


def fails(*_: object) -> None:
    raise RuntimeError("nothing can be noted")


class Measured(Wire):
    """The connection; notes how many calls lie between the reading of the key and its byte."""

    def __init__(self) -> None:
        super().__init__()
        self.frames: list[int] = []

    def send_urgent(self, data: bytes) -> None:
        names, frame = [], sys._getframe()
        while frame is not None and frame.f_code.co_name != "read_keys":
            names.append(frame.f_code.co_name)
            frame = cast("Any", frame.f_back)
        self.frames.append(len(names))
        super().send_urgent(data)


class Screen:
    """The application, as far as the thread that reads keys calls it."""

    stop_now, kill_now = ListeningApp.stop_now, ListeningApp.kill_now

    def __init__(self, ui: UiContext) -> None:
        self.ui = ui

    def situation(self) -> KeySituation:
        return KeySituation(page=PageName.RUN, moving=True)


class Driver(StopDriver):
    """The thread that reads keys, without a terminal. `queue` is where its messages go."""

    def __init__(self, app: Screen) -> None:
        self._app = app  # type: ignore[assignment]
        self._pace, self._codes, self._stopped_s = KeyPace(), ScanCollector(), float("-inf")
        self.age, self._drops, self.cursor_origin = answered_age(), False, None
        self.queue: list[Message] = []

    def send_message(self, message: Message) -> None:
        self.queue.append(message)

    def read_keys(self, *keys: str) -> None:
        for key in keys:
            self.process_message(events.Key(key, None))


def key_thread(monkeypatch: pytest.MonkeyPatch | None = None) -> tuple[Measured, Driver]:
    """The whole way as `console` builds it with a trace, an instructor's ear and a flight recorder."""
    wire, inbox, machine = Measured(), Inbox(time.monotonic), load_machine(MACHINE)
    tap: Any = inbox.put
    trace = SimpleNamespace(write=lambda line: None)
    if monkeypatch is not None:
        monkeypatch.setattr(Inbox, "put", fails)
        tap, trace = fails, SimpleNamespace(write=fails)
    link = TappedLink(TracedLink(TappedLink(RenewableLink(wire), tap), trace, time.monotonic), tap)
    thread = LinkThread("a lathe", True, lambda: cast("OpenMachine", None))
    station = cast("Any", SimpleNamespace(state=StationState(machine="a lathe", simulated=True)))
    thread._opened = OpenMachine(station=station, stop=StopPath(link), close=lambda: None)
    control = LoggedControl(RecordedControl(thread, inbox), fails, fails)  # type: ignore[arg-type]
    ui = UiContext(
        text=load("en"), palette=MONO, control=control, machine=machine, data=Path(), go=lambda page: None
    )
    ui.queued = True
    return wire, Driver(Screen(ui))


def test_a_stop_key_takes_a_short_way_to_its_byte() -> None:
    wire, driver = key_thread()
    driver.read_keys("space", "f9")
    assert len(wire.urgent) == 2
    assert max(wire.frames) <= MOST_FRAMES


def test_every_stop_goes_out_though_every_recorder_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    wire, driver = key_thread(monkeypatch)
    driver.read_keys("space", "f9", "f12")
    assert wire.urgent == [b"\x0b"] * 3
    assert [type(message).__name__ for message in driver.queue].count("StopSent") == 3
    assert not driver._app.ui.queued  # type: ignore[attr-defined]


@pytest.mark.parametrize("part", ["_pace", "_codes", "age"])
def test_a_fault_in_what_follows_a_stop_is_told_and_the_next_stop_goes_out(part: str) -> None:
    wire, driver = key_thread()
    setattr(driver, part, None)
    driver.read_keys("space", "space")
    assert len(wire.urgent) == 2
    assert [type(message).__name__ for message in driver.queue].count("KeyFault") == 2
