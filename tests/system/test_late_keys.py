"""Keys that come late, from a console that was frozen or over a line that stood still: nothing starts by them."""

from __future__ import annotations

import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from profiles.store import load_job
from tests.terminal import Terminal
from tests.trainee import FIRST_JOB, SETTLES_DEG, Trainee, console, console_at

pytestmark = [pytest.mark.system, pytest.mark.timeout(240)]

NOTHING_S = 2.0
"""Time in which whatever a late key started would be seen."""

DROPPED = ("screen.keys_late", "screen.keys_late_armed", "session.frozen")
Delay = Callable[..., None]


def frozen(trainee: Trainee, for_s: float, *keys: str) -> None:
    """Stop the process, press keys, and let it continue."""
    trainee.terminal.signal(signal.SIGSTOP)
    time.sleep(0.2)
    trainee.terminal.press(*keys)
    time.sleep(for_s)
    trainee.terminal.signal(signal.SIGCONT)


def held(trainee: Trainee, for_s: float, *keys: str) -> None:
    """Let the line stand still towards the console, press keys, and let it deliver everything."""
    trainee.terminal.hold()
    trainee.terminal.press(*keys)
    time.sleep(for_s)
    trainee.terminal.let_go()


DELAYS = [
    pytest.param(frozen, 3.0, id="frozen-3s"),
    *(
        pytest.param(delay, for_s, id=f"{delay.__name__}-{for_s:g}s", marks=pytest.mark.long)
        for delay, for_s in ((held, 1.0), (held, 3.0), (held, 12.0), (held, 60.0), (frozen, 12.0), (frozen, 22.0))
    ),
]
delays = pytest.mark.parametrize(("delay", "for_s"), DELAYS)


@contextmanager
def aligned(data: Path, length_mm: float = 4.0) -> Iterator[Trainee]:
    text = load_job(FIRST_JOB).path.read_text(encoding="utf-8")
    own = data / "jobs" / f"{FIRST_JOB}.toml"
    own.parent.mkdir()
    own.write_text(re.sub("(?m)^cut_length_mm = .*", f"cut_length_mm = {length_mm}", text), encoding="utf-8")
    with console(data, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        trainee.aligns()
        yield trainee


def says_so(trainee: Trainee) -> None:
    """One line says that something was dropped: by the keys, or by the pause of the polls."""
    trainee.terminal.wait_for(
        lambda text: any(re.search(trainee._pattern(f"problem.{code}"), text) for code in DROPPED), 5.0
    )


def stays_ready(trainee: Trainee) -> None:
    """Nothing is seen to move for a while; what the machine does is in the first row."""
    moves = [
        trainee._pattern(f"activity.{word}")
        for word in ("homing", "jogging", "positioning", "cutting", "approaching")
    ]
    ends_s = time.monotonic() + NOTHING_S
    while time.monotonic() < ends_s:
        row = trainee.terminal.row(0)
        assert not any(re.search(each, row) for each in moves), trainee.terminal.text
        time.sleep(0.05)


def arms(trainee: Trainee) -> None:
    trainee.press("5")
    trainee.sees("run_page.next.arm")
    trainee.press("f5")
    trainee.sees("run_page.next.armed")


@pytest.mark.long
@delays
def test_an_armed_cut_is_not_started_by_a_late_key(delay: Delay, for_s: float, tmp_path: Path) -> None:
    with aligned(tmp_path) as trainee:
        arms(trainee)
        delay(trainee, for_s, "f6")
        says_so(trainee)
        stays_ready(trainee)
        trainee.press("f6")
        trainee.sees("problem.screen.not_armed")
        trainee.starts_the_cut("run_page.next.arm")


@delays
def test_no_home_search_and_no_step_begins_by_a_late_key(delay: Delay, for_s: float, tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        delay(trainee, for_s, "f4")
        says_so(trainee)
        stays_ready(trainee)
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        trainee.press("j")
        trainee.sees("align_page.jog_on")
        before = trainee._jaw_to_go_deg()
        delay(trainee, for_s, "pageup")
        says_so(trainee)
        stays_ready(trainee)
        after = trainee._jaw_to_go_deg()
        assert before is not None and after is not None and abs(after - before) < SETTLES_DEG
        trainee.press("pageup")
        trainee.sees("problem.screen.jog_not_enabled")


def begins_no_cut(trainee: Trainee) -> None:
    ends_s = time.monotonic() + 2.0 * NOTHING_S
    while time.monotonic() < ends_s:
        assert not re.search(trainee._pattern("activity.cutting"), trainee.terminal.row(0)), trainee.terminal.text
        time.sleep(0.02)


def test_nothing_of_a_cut_begins_by_a_key_that_is_late_or_for_a_console_that_was_frozen(tmp_path: Path) -> None:
    """While it arms, armed, and on the way to the start: of what was left of it nothing is begun."""
    with aligned(tmp_path) as trainee:
        trainee.press("5")
        trainee.sees("run_page.next.arm")
        trainee.press("f5")
        trainee.sees("activity.arming")
        frozen(trainee, 3.0, "f6")
        says_so(trainee)
        trainee.sees("activity.ready", 20.0)
        time.sleep(1.0)
        trainee.sees("run_page.next.arm", 1.0)
        arms(trainee)
        held(trainee, 1.0, "f6")
        says_so(trainee)
        stays_ready(trainee)
        trainee.press("f6")
        trainee.sees("problem.screen.not_armed")
        arms(trainee)
        trainee.press("f6")
        trainee.sees("activity.positioning")
        frozen(trainee, 4.0)
        begins_no_cut(trainee)


@pytest.mark.long
def test_a_console_that_is_frozen_for_long_on_the_way_to_the_start_begins_no_cut(tmp_path: Path) -> None:
    with aligned(tmp_path) as trainee:
        arms(trainee)
        trainee.press("f6")
        trainee.sees("activity.positioning")
        frozen(trainee, 8.0)
        begins_no_cut(trainee)


@pytest.mark.parametrize(
    ("delay", "for_s"), [(held, 1.0), (frozen, 3.0), pytest.param(held, 3.0, marks=pytest.mark.long)]
)
def test_a_stop_that_waited_still_stops(delay: Delay, for_s: float, tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        delay(trainee, for_s, "f4", "space")
        trainee.terminal.wait_for(r"STOPPED", 10.0)  # the row of messages may say that keys were late
        stays_ready(trainee)


@pytest.mark.parametrize("for_s", [1.0, pytest.param(12.0, marks=pytest.mark.long)])
def test_a_held_cut_is_not_resumed_by_a_late_key(for_s: float, tmp_path: Path) -> None:
    with aligned(tmp_path, length_mm=16.0) as trainee:
        trainee.starts_the_cut()
        trainee.terminal.wait_for(r"turn +(2[5-9]|[3-9]\d) of", 20.0)  # earlier the carriage has no way back
        trainee.press("f4")
        trainee.sees("run_page.next.paused", 20.0)
        held(trainee, for_s, "f6")
        says_so(trainee)
        trainee.sees("run_page.next.paused", 1.0)
        trainee.press("space")
        trainee.sees("activity.stopped", 10.0)


def test_a_key_read_by_a_screen_that_could_not_draw_starts_nothing(tmp_path: Path) -> None:
    """The terminal takes no output, but sends keys: the screen obeys them only when it can draw again."""
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        terminal.stall()
        ends_s = time.monotonic() + 14.0  # on a busy computer, too, the line is full by then
        while time.monotonic() < ends_s and not terminal._unread():
            terminal.press("?")  # each draws much
            time.sleep(0.1)
        terminal.press("f4")
        time.sleep(3.0)
        terminal.resume()
        stays_ready(trainee)


ASK = """
from console.session.dated_input import read_line
line = read_line("name? ")
print("got", repr(line.text), "late" if line.late else "in time")
"""


@pytest.mark.parametrize(
    ("delay", "for_s"), [(held, 1.0), (frozen, 3.0), pytest.param(held, 12.0, marks=pytest.mark.long)]
)
def test_a_line_typed_to_a_question_has_its_age(delay: Delay, for_s: float) -> None:
    with Terminal([sys.executable, "-c", ASK], columns=80, rows=24) as terminal:
        terminal.wait_for("name\\?")
        delay(Trainee(terminal, "en"), for_s, "l", "1", "enter")
        terminal.wait_for("got 'l1' late", 5.0)
    with Terminal([sys.executable, "-c", ASK], columns=80, rows=24) as terminal:
        terminal.wait_for("name\\?")
        time.sleep(0.5)
        terminal.type("ab\x7f1\r")
        terminal.wait_for("name\\? ab?.*\n?got 'a1' in time", 5.0)
