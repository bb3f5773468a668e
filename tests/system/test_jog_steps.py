"""Presses of a jog key at the real program in a real terminal: each is a step, and a stop leaves none of them."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import pytest

from console.session.data.stop_records import simulated_record, store
from console.tui.pace import QUIET_S
from drivers.clock import RealClock
from drivers.link.address import TcpAddress
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS
from profiles.store import load_machine
from tests.signed_profile import signed
from tests.system.conftest import ANYWHERE, Serve
from tests.system.lathe_sites import compact_text
from tests.terminal import KittyTerminal, Terminal
from tests.trainee import FIRST_JOB, Trainee, console, console_at

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

PRESSES = 6
PRESS_S = 0.3
"""Between two presses: well above what the console takes for a held key (0.12 s), on a busy computer too."""
STEP_DEG, LONGER_DEG, LONGER = 1.0, 30.0, 5
RESOLUTION_DEG = 0.05
"""A count of the spindle is 0.036 deg; its servo rests within one of them."""


def angle_deg(trainee: Trainee) -> float:
    found = re.search(r"C spindle\s+([\d.]+) °", trainee.terminal.text)
    assert found is not None, trainee.terminal.text
    return float(found[1])


def turned_deg(trainee: Trainee, before: float) -> float:
    return (angle_deg(trainee) - before + 180.0) % 360.0 - 180.0


@pytest.mark.long
def test_every_press_is_a_step_and_a_stop_leaves_none(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        trainee.press("j", "+")
        terminal.wait_for(r"\[1\.00\]", 5.0)

        before = angle_deg(trainee)
        trainee.press(*["pageup"] * PRESSES, pace_s=PRESS_S)
        terminal.wait_for(rf"✓ steps: {PRESSES}", 20.0)
        terminal.wait_for(lambda _: abs(turned_deg(trainee, before) - PRESSES * STEP_DEG) < RESOLUTION_DEG, 5.0)

        trainee.press("+", "+", *["pageup"] * LONGER)
        terminal.wait_for(r"\d of \d steps", 5.0)
        trainee.press("space")
        # In a step it asks for F2; between two of them there was nothing to stop but what waited.
        terminal.wait_for(lambda text: "F2 resets" in text or "j enables the jog; turn" in text, 10.0)
        if "F2 resets" in terminal.text:
            trainee.press("f2")
        trainee.sees("align_page.next.jaw_enable", 10.0)
        stopped = angle_deg(trainee)  # less than a turn further on
        assert turned_deg(trainee, before) < PRESSES * STEP_DEG + LONGER * LONGER_DEG - RESOLUTION_DEG
        # The jog, enabled again, does not continue with what was left.
        trainee.press("j")
        terminal.wait_for(r"jog enabled, 2\d s left", 5.0)
        assert abs(turned_deg(trainee, stopped)) < RESOLUTION_DEG


REPEAT_S, FIRST_S = 0.03, 0.4
"""Of the keyboard in this test: as in most settings."""

PAGE_UP = "\x1b[5~"


def holds(trainee: Trainee, typed: str, for_s: float) -> None:
    """Hold a key down: its first press, after a while its repeats, and then nothing."""
    ends_s = time.monotonic() + for_s
    trainee.terminal.type(typed)
    time.sleep(FIRST_S)
    while time.monotonic() < ends_s:
        trainee.terminal.type(typed)
        time.sleep(REPEAT_S)


@pytest.mark.long
def test_a_held_key_runs_once_the_terminal_is_measured_and_ends_with_its_release(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        for _ in range(4):  # on a busy computer a repeat may come late: then the jog stays step only, and says so
            holds(trainee, "h", 3.3)
            terminal.wait_for(lambda text: "the terminal repeats" in text or "do not repeat" in text, 5.0)
            if "the terminal repeats" in terminal.text:
                break
            time.sleep(1.0)
        terminal.wait_for(r"Jog, hold: ≤ [\d.]+° over", 5.0)
        shown = re.search(r"Jog, hold: ≤ ([\d.]+)° over", terminal.text)
        assert shown is not None
        time.sleep(1.0)  # what comes at once behind a repeat is no key of a person
        trainee.press("j")
        terminal.wait_for("jog enabled", 5.0)
        before = angle_deg(trainee)
        holds(trainee, PAGE_UP, 2.0)
        released = angle_deg(trainee)
        time.sleep(1.5)
        rested = angle_deg(trainee)
        # Steps of 0.1 degrees; the screen is up to a step behind.
        assert turned_deg(trainee, before) >= 0.2 - RESOLUTION_DEG
        assert turned_deg(trainee, released) <= float(shown[1]) + 0.1 + RESOLUTION_DEG
        time.sleep(1.0)
        assert abs(turned_deg(trainee, rested)) < RESOLUTION_DEG


# A jog key that is held at a real terminal, whose line then stands still: how far the lathe really goes on.


HELD_FIRST_S, HELD_REPEAT_S = 0.4, 0.03
HELD_PAGE_UP = b"\x1b[5~"
BUFFERED = 40
"""Repeats that the line holds back, some 1.2 s of a held key."""

COUNT_DEG = 0.05
"""A count of the spindle is 0.036 deg; its servo rests within one of them."""

RELAY = "import os\nwhile data := os.read(0, 4096): os.write(1, data)"


@dataclass(frozen=True, kw_only=True)
class Keyboard:
    """What a held PgUp sends in this kind of terminal; `shown` finds its overrun on a silent line in the title."""

    repeat: bytes
    release: bytes
    shown: str
    released: str


PLAIN = Keyboard(repeat=HELD_PAGE_UP, release=b"", shown=r"Jog, hold: ≤ ([\d.]+)° over", released="")
KITTY = Keyboard(
    repeat=b"\x1b[5;1:2~",
    release=b"\x1b[5;1:3~",
    shown=r"Jog: release ≤ [\d.]+, lost ≤ ([\d.]+)°",
    released=r"Jog: release ≤ ([\d.]+), lost",
)


@dataclass(frozen=True, kw_only=True)
class Bench:
    """A console ready to jog the spindle; the line of its keyboard; another host of the lathe."""

    trainee: Trainee
    relay: subprocess.Popen[bytes]
    keyboard: Keyboard
    lathe: PmacClient
    counts_per_rev: float

    def types(self, data: bytes) -> None:
        """Send through the relay, which may stand still."""
        assert self.relay.stdin is not None
        os.write(self.relay.stdin.fileno(), data)

    def holds(self, for_s: float) -> None:
        """Press PgUp, and hold it down."""
        ends_s = time.monotonic() + for_s
        self.types(HELD_PAGE_UP)
        time.sleep(HELD_FIRST_S)
        while time.monotonic() < ends_s:
            self.types(self.keyboard.repeat)
            time.sleep(HELD_REPEAT_S)

    def angle_deg(self) -> float:
        (counts,) = self.lathe.numbers("#2P")
        return 360.0 * counts / self.counts_per_rev

    def rests(self) -> float:
        """Wait until the spindle stands still; return its angle, that of many turns."""
        before, deadline_s = self.angle_deg(), time.monotonic() + 10.0
        while time.monotonic() < deadline_s:
            time.sleep(0.7)  # longer than any step that a held key may make
            if abs((now := self.angle_deg()) - before) < COUNT_DEG:
                return now
            before = now
        raise AssertionError(f"still turning at {before} deg")

    def may_go_on(self, pattern: str) -> float:
        found = re.search(pattern, self.trainee.terminal.text)
        assert found is not None, self.trainee.terminal.text
        return float(found[1])


@contextmanager
def bench(serve: Serve, data: Path, kind: type[Terminal], keyboard: Keyboard) -> Iterator[Bench]:
    profile = data / "lathe.toml"
    profile.write_text(signed(compact_text("pmac")), encoding="utf-8")
    machine = load_machine(str(profile)).machine
    with serve("--machine", str(profile), "--tcp", ANYWHERE) as served:
        address = f"tcp:{served.tcp[0]}:{served.tcp[1]}"
        record = simulated_record(machine, DIALECTS["pmac"], date.today())
        store(data, machine, replace(record, address=address))
        words = ("--link", address, "--machine", str(profile), "--data", str(data), "--lang", "en")
        with (
            kind([sys.executable, "-m", "console", *words]) as terminal,
            subprocess.Popen(
                [sys.executable, "-c", RELAY], stdin=subprocess.PIPE, stdout=terminal._master, bufsize=0
            ) as relay,
            closing(TcpLink(TcpAddress(host=served.tcp[0], port=served.tcp[1]))) as link,
        ):
            trainee = Trainee(terminal, "en")
            trainee.opens_the_first_job()
            trainee.switches_on()
            trainee.starts_homing()
            trainee.sees("align_page.next.jaw_enable", 30.0)
            lathe = PmacClient(link, RealClock())
            lathe.connect()
            try:
                yield Bench(
                    trainee=trainee,
                    relay=relay,
                    keyboard=keyboard,
                    lathe=lathe,
                    counts_per_rev=machine.spindle.counts_per_rev,
                )
            finally:
                relay.kill()


def calibrates(trainee: Trainee) -> None:
    """Hold h, until the repeats were even enough; on a busy computer one may come late."""
    for _ in range(4):
        trainee.terminal.type("h")
        time.sleep(HELD_FIRST_S)
        ends_s = time.monotonic() + 2.9
        while time.monotonic() < ends_s:
            trainee.terminal.type("h")
            time.sleep(HELD_REPEAT_S)
        trainee.terminal.wait_for(lambda text: "the terminal repeats" in text or "do not repeat" in text, 5.0)
        if "the terminal repeats" in trainee.terminal.text:
            return
        time.sleep(1.0)


def stalls_in_a_hold(at: Bench, *, for_s: float, then: Callable[[], None]) -> None:
    """Hold the key; the line stands still in the middle, the key stays down; then it brings everything at once."""
    at.trainee.press("j")
    at.trainee.terminal.wait_for("jog enabled", 5.0)
    before = at.rests()
    silent = at.may_go_on(at.keyboard.shown)
    at.holds(for_s)
    os.kill(at.relay.pid, signal.SIGSTOP)
    stalled = at.angle_deg()
    for _ in range(BUFFERED):
        at.types(at.keyboard.repeat)
    then()
    rested = at.rests()
    assert stalled - before >= 0.2 - COUNT_DEG, "it ran"
    assert rested - stalled <= silent + COUNT_DEG
    os.kill(at.relay.pid, signal.SIGCONT)
    at.trainee.terminal.wait_until_read(2.0)
    assert abs(at.rests() - rested) < COUNT_DEG, "what came late has moved it"


@pytest.mark.long
def test_a_line_that_stands_still_while_a_key_repeats(serve: Serve, tmp_path: Path) -> None:
    with bench(serve, tmp_path, Terminal, PLAIN) as at:
        calibrates(at.trainee)
        at.trainee.terminal.wait_for(PLAIN.shown, 5.0)
        time.sleep(1.0)  # what comes at once behind a repeat is no key of a person
        stalls_in_a_hold(at, for_s=1.5, then=lambda: None)


@pytest.mark.long
def test_a_reported_release_ends_it_and_a_lost_one_does_no_harm(serve: Serve, tmp_path: Path) -> None:
    with bench(serve, tmp_path, KittyTerminal, KITTY) as at:
        terminal = at.trainee.terminal
        assert isinstance(terminal, KittyTerminal)
        terminal.wait_for(KITTY.shown, 5.0)
        assert terminal.flags[-1] == 0b11011
        at.trainee.press("j")
        terminal.wait_for("jog enabled", 5.0)
        before, shown = at.rests(), at.may_go_on(KITTY.released)
        at.holds(1.5)
        released = at.angle_deg()
        at.types(KITTY.release)
        rested = at.rests()
        assert released - before >= 0.2 - COUNT_DEG, "it ran"
        assert rested - released <= shown + COUNT_DEG
        # The release and another press are among what the line holds back.
        stalls_in_a_hold(at, for_s=1.5, then=lambda: at.types(KITTY.release + HELD_PAGE_UP + KITTY.release))
        at.trainee.press("5")
        terminal.wait_for(lambda _: terminal.flags[-1] == 0b11001, 5.0)
        at.trainee.press("4")
        terminal.wait_for(lambda _: terminal.flags[-1] == 0b11011, 5.0)
        terminal.signal(signal.SIGTERM)
        terminal.wait_exit()
        assert terminal.flags == (0,)


# A wedge scanner at the real program: its code opens a job where Enter would, and never does anything else.


OTHER = "ring-7"
SAME_PIECE_S = 0.2


@contextmanager
def at_a_console(data: Path) -> Iterator[Trainee]:
    with console(data, "en", 80, 24, short_ways=True) as terminal:
        text = (data / "jobs" / f"{FIRST_JOB}.toml").read_text(encoding="utf-8")
        named = re.sub(r'(?m)^name = ".*"', f'name = "{OTHER}"', text)
        (data / "jobs" / f"{OTHER}.toml").write_text(named, encoding="utf-8")
        yield console_at(terminal)


def types(trainee: Trainee, *pieces: str) -> None:
    """Type pieces as a line brings them, each at once."""
    for piece in pieces:
        trainee.terminal.type(piece)
        time.sleep(SAME_PIECE_S)
    time.sleep(QUIET_S)


@pytest.mark.first(1)
@pytest.mark.parametrize("pieces", [(f"job:{OTHER}\r",), (f"JOB:{OTHER[:3]}", f"{OTHER[3:]}\r\n")])
def test_a_code_opens_its_job_and_no_other_does_anything(tmp_path: Path, pieces: tuple[str, ...]) -> None:
    with at_a_console(tmp_path) as trainee:
        terminal = trainee.terminal
        trainee.press("4")
        trainee.sees("align_page.next.clamp")
        types(trainee, f"b:{OTHER}\r")  # its prefix was cut off
        terminal.wait_for(rf'scanned "b:{OTHER}"', 2.0)
        trainee.sees("align_page.next.clamp")
        types(trainee, "job:nothing\r")
        trainee.sees("problem.screen.scanned_no_job", 2.0)
        types(trainee, "ㅓㅐㅠ:ㄹ미ㅏ\n")
        trainee.sees("problem.screen.scanned_no_job", 2.0)
        trainee.sees("align_page.next.clamp")
        types(trainee, *pieces)
        terminal.wait_for(f"Set-up: {OTHER}", 5.0)
        assert "STOPPED" not in terminal.text


@pytest.mark.long
def test_in_an_entry_or_in_motion_no_job_is_opened(tmp_path: Path) -> None:
    """Rules M4 and M6: nothing changes the job while anything moves, and an entry is the operator's."""
    with at_a_console(tmp_path) as trainee:
        terminal, code = trainee.terminal, f"job:{OTHER}\r"
        trainee.press("down", "enter")
        trainee.sees("setup.next.entry", 2.0)
        types(trainee, code)
        trainee.sees("problem.screen.too_fast_entry", 2.0)
        assert f"Set-up: {FIRST_JOB}" in terminal.text
        trainee.press("u")
        trainee.switches_on()
        trainee.starts_homing()
        types(trainee, code)
        trainee.sees("problem.screen.scanned_stopped", 5.0)
        trainee.sees("activity.stopped", 10.0)
        trainee.press("f2")
        trainee.sees("align_page.next.home", 10.0)
        terminal.wait_for(FIRST_JOB[-8:], 2.0)
