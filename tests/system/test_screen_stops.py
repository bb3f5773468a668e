"""Stops at a real terminal: whatever is pressed, wherever, the controller proves rest soon after."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from textual import events
from textual.message import Message

from console.tui.driver import Reader, StopDriver
from console.tui.gate import FieldKind, KeySituation
from console.tui.keymap import PageName
from console.tui.pace import KeyPace, ScanCollector
from tests.terminal import KEYS
from tests.trainee import Trainee, console, console_at
from tests.tui.stage import answered_age

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

REST_S = 3.0
"""From the key to the controller's proof of rest on the screen."""

PENDING = ("\x1b", "\x1bd", "u", "\x1b[1 ")
"""Ends of what may go on, so that it is known only after a while what was said."""

NO_KEY = "unreadable input"
PASTE = "\x1b[200~G0 X-10\r\x1b[201~"
SUPPORT_REPLY, RELEASE, ARROW_RELEASE = "\x1b[?27u", "\x1b[97;1:3u", "\x1b[1;1:3A"


@pytest.fixture
def trainee(tmp_path: Path) -> Iterator[Trainee]:
    """At the page Align, with the drives on."""
    with console(tmp_path, "en", 80, 24) as terminal:
        ready = console_at(terminal)
        ready.switches_on()
        yield ready


@pytest.fixture(scope="module")
def once_started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Trainee]:
    """The same, for all that end as they began: at rest, the stop taken back, nothing open, 80 by 24."""
    with console(tmp_path_factory.mktemp("stops"), "en", 80, 24) as terminal:
        ready = console_at(terminal)
        ready.switches_on()
        yield ready


def is_stopped_by(trainee: Trainee, reason: str) -> None:
    """Rest is proven in time, and the row says what stopped the machine; then go on."""
    trainee.sees("activity.stopped", REST_S)
    trainee.terminal.wait_for(rf"Stopped \({re.escape(reason)}\)\.", 1.0)
    at_rest = re.search(r"(?:proven in|rest proven after) ([\d.]+) s", trainee.terminal.text)
    assert at_rest is not None and float(at_rest[1]) < REST_S, trainee.terminal.text
    trainee.press("f2")
    trainee.sees("activity.ready", 5.0)


def homes_again(trainee: Trainee) -> None:
    """Start the home search on the page Align, with the drives on once more where the stop switched them off."""
    trainee.press("4")
    trainee.terminal.wait_for("F4 (homes|enables the drives)", 5.0)
    if "F4 enables the drives" in trainee.terminal.text:
        trainee.does_step("align_page.next.home")
    trainee.starts_homing()


def goes_to(trainee: Trainee, page: str, title: str) -> None:
    trainee.press(page)
    trainee.terminal.wait_for(title, 2.0)


def test_a_stop_key_stops_on_every_page(once_started: Trainee) -> None:
    trainee = once_started
    for page, key, reason in (
        ("1", "space", "Space"),
        ("2", "escape", "Esc"),
        ("3", "f12", "F12"),
        ("4", "f9", "F9, drives disabled"),
        ("5", "space", "Space"),
        ("6", "f12", "F12"),
    ):
        homes_again(trainee)
        trainee.press(page, key)
        is_stopped_by(trainee, reason)


@pytest.mark.parametrize(
    "typed",
    [
        {
            "x": "unassigned key x",
            "\x1bd": "unassigned key alt+d",
            PASTE: "pasted text",
            KEYS["f11"]: "unassigned key F11",
            KEYS["ctrl+t"]: "unassigned key ctrl+t",
            KEYS["left"]: "← pressed in motion",
        },
        dict.fromkeys((RELEASE, ARROW_RELEASE, "\x1b[99999999999u"), NO_KEY),
    ],
)
def test_what_means_nothing_or_something_else_stops_what_moves_and_is_named(
    once_started: Trainee, typed: dict[str, str]
) -> None:
    trainee = once_started
    for text, reason in typed.items():
        homes_again(trainee)
        trainee.terminal.type(text)
        is_stopped_by(trainee, reason)


def test_bytes_that_are_no_text_stop_what_moves(once_started: Trainee) -> None:
    trainee = once_started
    homes_again(trainee)
    os.write(trainee.terminal._master, b"\xff\xfe")
    is_stopped_by(trainee, "unassigned key \ufffd")


def test_a_paste_whose_end_is_lost_stops_and_does_not_keep_the_keys(once_started: Trainee) -> None:
    trainee = once_started
    homes_again(trainee)
    trainee.terminal.type("\x1b[200~G0 X-10")
    is_stopped_by(trainee, "pasted text")
    homes_again(trainee)
    trainee.press("space")
    is_stopped_by(trainee, "Space")


def test_with_the_help_open_a_key_stops_as_well(once_started: Trainee) -> None:
    trainee = once_started
    for key, reason in (("space", "Space"), ("escape", "Esc"), ("x", "unassigned key x")):
        homes_again(trainee)
        trainee.press("?")
        trainee.sees("key_help.align.enable", 2.0)
        trainee.press(key)
        is_stopped_by(trainee, reason)


def test_in_a_terminal_that_is_too_small_space_stops(once_started: Trainee) -> None:
    trainee = once_started
    homes_again(trainee)
    trainee.terminal.resize(40, 10)
    trainee.terminal.wait_for("terminal too small", 2.0)
    trainee.press("space")
    trainee.terminal.resize(80, 24)
    is_stopped_by(trainee, "Space")


def test_a_stop_does_not_wait_for_a_screen_that_hangs(trainee: Trainee) -> None:
    """The line takes nothing, but what is typed comes in: the stop goes out before the screen knows of it."""
    terminal = trainee.terminal
    terminal.resize(160, 48)
    homes_again(trainee)
    terminal.stall()
    terminal.press(*["?"] * 80, "space")
    # Had the key waited, the watch over the screen would have stopped the machine, or the search been over.
    with pytest.raises(AssertionError, match="not on the screen"):
        terminal.wait_for("STOPPED", 4.0)
    terminal.resume()
    terminal.wait_for("STOPPED", 10.0)  # behind all that was typed; how soon it rested is on the screen
    is_stopped_by(trainee, "Space")


def test_in_a_field_of_numbers_space_stops_and_in_free_text_f12_does(trainee: Trainee) -> None:
    """At rest: nothing can be typed while something moves."""
    goes_to(trainee, "2", "Set-up: lee-2001")
    trainee.press("down", "enter")
    trainee.sees("setup.next.entry", 2.0)
    trainee.press("5")
    trainee.press("space")
    trainee.terminal.wait_for("nothing moved: no reset", 5.0)
    trainee.press("enter")
    trainee.sees("setup.next.entry", 2.0)
    trainee.terminal.wait_for(r"no alarms", 5.0)  # in place of the answer
    assert "nothing moved" not in trainee.terminal.text
    trainee.terminal.type("5 ")  # at once, as a busy line or computer brings them
    trainee.terminal.wait_for("nothing moved: no reset", 5.0)
    trainee.press("u")
    trainee.press("s")
    trainee.sees("setup.next.naming", 2.0)
    trainee.terminal.wait_for(re.escape("[F12] STOP MOTION"), 2.0)
    trainee.terminal.type("two parts")
    trainee.terminal.wait_for("two parts", 2.0)
    assert "STOPPED" not in trainee.terminal.text
    trainee.press("f12")
    trainee.terminal.wait_for("nothing moved: no reset", 5.0)


def test_a_stop_while_it_connects_is_in_force_when_the_machine_is_there(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = Trainee(terminal, "en")
        terminal.wait_for("SIM", 10.0)
        trainee.press("space")
        assert "connecting" in terminal.row(0)
        trainee.sees("activity.stopped", 10.0)
        terminal.wait_for(r"Stopped \(Space\)\.", 1.0)
        trainee.press("enter")
        goes_to(trainee, "4", "Steps")
        trainee.press("f4")
        terminal.wait_for("the machine was stopped", 2.0)
        trainee.sees("align_page.drives_off", 2.0)
        trainee.press("f2")
        trainee.sees("activity.ready", 5.0)


@pytest.mark.long
def test_what_a_terminal_says_of_itself_does_nothing_at_rest(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("activity.ready")
        for turn, said in enumerate((SUPPORT_REPLY, RELEASE, ARROW_RELEASE, "\x1b[0;1:2u", "\x1b[<0;1;1M")):
            key, number = (("down", 2), ("up", 1))[turn % 2]
            terminal.type(said)
            # The key behind it is answered, on the page that was there; neither help nor another page came.
            trainee.scans("")  # what came close to it would be no key of a person
            trainee.press(key)
            terminal.wait_for(rf"▸[ ●]*lee-2001-experiment-{number}", 5.0)
            trainee.press("enter")
            terminal.wait_for(f"Set-up: lee-2001-experiment-{number}", 3.0)
            trainee.press("1")
            terminal.wait_for(rf"▸[ ●]*lee-2001-experiment-{number}", 3.0)
        terminal.press("ctrl+q")
        assert terminal.wait_exit(2.0) == 0


def keys_of(typed: str) -> list[str]:
    """What is made of characters that come at once, and of half a second without any behind them."""
    reader = Reader()
    said = [message for character in typed for message in reader.read(character, 0.0)]
    deadline_s = time.monotonic() + 5.0
    while not (last := reader.idle(0.0)) and typed.endswith(PENDING) and time.monotonic() < deadline_s:
        time.sleep(0.01)
    return [m.key if isinstance(m, events.Key) else type(m).__name__ for m in (*said, *last, *reader.idle(1.0))]


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        ("a ", ["a", "space"]),
        ("\x1b[A\x1b[A\x1bOS", ["up", "up", "f4"]),
        ("\x1b", ["escape"]),
        ("\x1b\x1b[A", ["escape", "up"]),
        ("\x1bd", ["alt+d"]),
        # A reply, also with a key or a stop close behind it; a release; a sequence cut off before a Space.
        (SUPPORT_REPLY, []),
        (SUPPORT_REPLY + "\x1b[B", ["down"]),
        (RELEASE + " ", ["unreadable", "space"]),
        ("\x1b[1 ", ["space"]),
        # A paste, and one whose end does not come.
        (PASTE, ["paste", "Paste"]),
        ("\x1b[200~ 4", ["paste", "unreadable"]),
    ],
)
def test_what_a_terminal_says_becomes_keys_that_were_pressed_and_no_others(typed: str, keys: list[str]) -> None:
    assert keys_of(typed) == keys


class Frozen:
    """An application whose loop does not run, in a field of numbers."""

    def __init__(self, *, moving: bool = False) -> None:
        self.happened: list[str] = []
        self.now = KeySituation(page=PageName.SETUP, field=FieldKind.NUMBER, moving=moving)

    def situation(self) -> KeySituation:
        return self.now

    def stop_now(self, key: str) -> None:
        self.happened.append(f"stop {key}")

    def kill_now(self, key: str) -> None:
        self.happened.append(f"kill {key}")


class LoopBehind(StopDriver):
    """A driver without a terminal, whose messages go into a list."""

    def __init__(self, app: Frozen) -> None:
        self._app = app  # type: ignore[assignment]
        self.cursor_origin = None
        self._pace = KeyPace()
        self._codes = ScanCollector()
        self._stopped_s = float("-inf")
        self.age, self._drops = answered_age(), False

    def send_message(self, message: Message) -> None:
        self._app.happened.append(f"queued {type(message).__name__}")  # type: ignore[attr-defined]


def test_a_stop_is_sent_before_the_key_is_queued() -> None:
    app = Frozen()
    driver = LoopBehind(app)
    for key in ("space", "escape", "f12", "f9"):
        driver.process_message(events.Key(key, None))
    assert [each for each in app.happened if each != "queued TooFast"] == [
        *("stop space", "queued StopSent"),
        *("stop escape", "queued StopSent"),
        *("stop f12", "queued StopSent"),
        *("kill f9", "queued StopSent"),
    ]


def test_a_key_that_means_nothing_stops_before_it_is_queued_and_is_not_held_back() -> None:
    app = Frozen(moving=True)
    LoopBehind(app).process_message(events.Key("x", "x"))
    assert app.happened == ["stop unbound x", "queued StopSent"]


class Broken(Frozen):
    """An application that cannot tell what a key means now."""

    def situation(self) -> KeySituation:
        raise RuntimeError


@pytest.mark.parametrize("key", ["space", "escape", "f12", "x"])
def test_a_stop_goes_out_whatever_the_application_is_at(key: str) -> None:
    app = Broken()
    LoopBehind(app).process_message(events.Key(key, None))
    assert app.happened[0].startswith("stop ")


@pytest.mark.long
def test_a_character_goes_into_its_field_at_once_and_what_would_end_the_entry_waits() -> None:
    app = Frozen()
    driver = LoopBehind(app)
    driver.process_message(events.Key("1", "1"))
    assert app.happened == ["queued Written"]
    driver.process_message(events.Key("enter", "\r"))
    assert app.happened[1:] == ["queued TooFast"]
