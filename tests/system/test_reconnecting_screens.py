"""The screens of a real lathe whose line is cut and mended: at rest, in mid-homing, in mid-cut, over each link."""

from __future__ import annotations

import os
import re
import select
import socket
import sys
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Self

import pytest

from console.session.data.run_reader import runs
from console.session.data.run_rows import RunOutcome
from console.session.data.stop_records import simulated_record, store
from drivers.pmac.dialect import DIALECTS
from profiles.store import load_machine
from tests.signed_profile import signed
from tests.system.conftest import ANYWHERE, Serve
from tests.system.lathe_sites import compact_text
from tests.terminal import Terminal
from tests.trainee import Trainee

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]


CHUNK = 65_536
TICK_S = 0.02


class CuttableLine:
    """Use it as a context manager; `address` is what the console is given. `connections` counts them."""

    def __init__(self, kind: str, upstream: tuple[str, int], folder: Path) -> None:
        self._kind, self._upstream, self._name = kind, upstream, folder / "ttyLathe"
        self._whole, self._ended = threading.Event(), threading.Event()
        self._cut_now = threading.Event()
        self._port = 0
        self.connections = 0
        self._lock = threading.Lock()
        self._listener: socket.socket | None = None
        if kind != "serial":
            self._listen()
            self.address = f"{kind}:127.0.0.1:{self._port}"
        else:
            self.address = f"serial:{self._name}?baud=4000000"
        self._whole.set()
        self._thread = threading.Thread(target=self._run, name="line", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        if self._kind == "serial":
            while not self._name.exists():
                self._ended.wait(TICK_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self.cut()
        self._thread.join(5.0)

    def cut(self) -> None:
        """Cut what is connected; nobody connects any more."""
        self._whole.clear()
        with self._lock:
            if self._listener is not None:
                self._listener.close()
                self._listener = None

    def mend(self) -> None:
        """Let the console connect again, at the same address."""
        if self._kind != "serial":
            self._listen()
        self._whole.set()

    def _listen(self) -> None:
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", self._port))
        listener.listen()
        self._port = listener.getsockname()[1]
        with self._lock:
            self._listener = listener

    def _run(self) -> None:
        while not self._ended.is_set():
            if not self._whole.wait(TICK_S):
                continue
            if self._kind == "serial":
                self._carry_serial()
            else:
                self._carry_socket()

    def _carry_socket(self) -> None:
        with self._lock:
            listener = self._listener
        if listener is None:
            return
        with suppress(OSError, ValueError):
            if not select.select([listener], [], [], TICK_S)[0]:
                return
            console, _ = listener.accept()
            with console:
                self._carry(console.fileno())

    def _carry_serial(self) -> None:
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        self._name.symlink_to(os.ttyname(theirs))
        try:
            self._carry(ours)
        finally:
            self._name.unlink()
            os.close(ours)
            os.close(theirs)

    def _carry(self, console: int) -> None:
        """Pass bytes on until the line is cut, or one side ends."""
        self.connections += 1
        with socket.create_connection(self._upstream) as lathe, suppress(OSError):
            lathe.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while self._whole.is_set() and not self._ended.is_set():
                for end in select.select([console, lathe.fileno()], [], [], TICK_S)[0]:
                    data = os.read(end, CHUNK)
                    if not data:
                        return
                    os.write(lathe.fileno() if end == console else console, data)


BACK_S = 15.0


@dataclass(frozen=True, kw_only=True)
class Site:
    """A console in a terminal, and the line to its lathe."""

    terminal: Terminal
    trainee: Trainee
    line: CuttableLine
    data: Path

    def messages(self) -> str:
        """Return the list of messages."""
        self.trainee.press("w")
        self.terminal.wait_for(r"^\s*\d+ alarms?\b")
        return self.terminal.text


@contextmanager
def site(serve: Serve, data: Path, kind: str, rows: int = 44) -> Iterator[Site]:
    family = "turbo" if kind == "ethernet" else "pmac"
    profile = data / "lathe.toml"
    profile.write_text(signed(compact_text(family)), encoding="utf-8")
    machine = load_machine(str(profile)).machine
    with serve("--machine", str(profile), "--ethernet" if kind == "ethernet" else "--tcp", ANYWHERE) as served:
        upstream = served.ethernet if kind == "ethernet" else served.tcp
        with CuttableLine(kind, upstream, data) as line:
            record = simulated_record(machine, DIALECTS[family], date.today())
            store(data, machine, replace(record, address=line.address))
            words = ("--link", line.address, "--machine", str(profile), "--data", str(data), "--lang", "en")
            with Terminal([sys.executable, "-m", "console", *words], columns=100, rows=rows) as terminal:
                trainee = Trainee(terminal, "en")
                trainee.opens_the_first_job()
                yield Site(terminal=terminal, trainee=trainee, line=line, data=data)


OTHERS = [pytest.param(kind, marks=pytest.mark.long) for kind in ("ethernet", "serial")]


@pytest.mark.parametrize("kind", ["tcp", *OTHERS])
def test_a_line_that_was_cut_at_rest_comes_back_stopped(serve: Serve, tmp_path: Path, kind: str) -> None:
    """Rules A10 and R3: the age of what is shown, then the true state and what is still valid."""
    with site(serve, tmp_path, kind) as lathe:
        trainee, terminal = lathe.trainee, lathe.terminal
        trainee.switches_on()
        lathe.line.cut()
        trainee.sees("activity.lost", 10.0)
        terminal.wait_for(r"STALE, [1-9]\d* s", 5.0)
        terminal.wait_for(r"attempt [2-9]", 10.0)
        lathe.line.mend()
        trainee.sees("activity.stopped", BACK_S)
        terminal.wait_for(r"Link back after [\d.]+ s", 5.0)
        shown = lathe.messages()
        assert re.search("home: not homed yet", shown) and "does not see the chuck" in re.sub(r"\s+", " ", shown)
        trainee.press("backspace", "f2")
        trainee.sees("activity.ready", 5.0)
        trainee.sees("align_page.next.drives", 5.0)


@pytest.mark.long
def test_a_line_that_is_cut_in_mid_homing(serve: Serve, tmp_path: Path) -> None:
    with site(serve, tmp_path, "tcp") as lathe:
        trainee = lathe.trainee
        trainee.switches_on()
        trainee.starts_homing()
        lathe.line.cut()
        trainee.sees("activity.lost", 10.0)
        lathe.line.mend()
        trainee.sees("activity.stopped", BACK_S)
        assert "home: not homed yet" in lathe.messages() or "home: lost" in lathe.terminal.text
        trainee.press("backspace", "f2")
        trainee.sees("align_page.next.drives", 5.0)
        trainee.does_step("align_page.next.home")


@pytest.mark.long
def test_a_line_that_is_cut_in_mid_cut(serve: Serve, tmp_path: Path) -> None:
    """The controller has taken the tool out; the run has an end in the record, before the console is left."""
    with site(serve, tmp_path, "tcp") as lathe:
        trainee, terminal = lathe.trainee, lathe.terminal
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        trainee.press("enter")
        trainee.sees("align_page.next.touch_off")
        trainee.press("f4")
        terminal.wait_for(r"R 28\.0000 mm", 30.0)
        trainee.sees("activity.ready", 30.0)
        trainee.press("j", "+", *["down"] * 10)
        terminal.wait_for(r"R 27\.0000 mm", 10.0)  # near enough to count as a touch-off: the cut is in air
        trainee.sees("activity.ready", 10.0)
        trainee.press("enter")
        trainee.sees("align_page.valid_title")
        trainee.starts_the_cut()
        terminal.wait_for(r"CUTTING . in sync", 20.0)
        lathe.line.cut()
        trainee.sees("activity.lost", 10.0)
        lathe.line.mend()
        trainee.sees("activity.stopped", BACK_S)
        shown = re.sub(r"\s+", " ", lathe.messages())
        for stamp in ("home", "jaw 1", "touch-off", "clamping"):
            assert f"{stamp}: valid" in shown, shown
        trainee.press("backspace", "f2")
        trainee.sees("activity.ready", 5.0)
        (run,) = runs(lathe.data, limit=5)
        assert run.ended.how is RunOutcome.STOPPED and run.ended.reason == "link.closed" and run.failed
