"""What tells somebody to act is whole on a real screen of 80 x 24, in Korean, whose letters take two columns."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

from console.session.data.records import FOLDER
from console.session.feed.place import connect_feed, feeds
from console.text.catalogue import load
from profiles.problem import Problem
from profiles.store import load_machine
from tests.console.test_run_record import begins, killed
from tests.preloaded import Preloaded, completed
from tests.signed_profile import signed
from tests.system.conftest import Serve
from tests.system.lathe_sites import compact_text
from tests.terminal import Terminal
from tests.trainee import Trainee, console, console_at, simulator_of

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

MISSING = (
    "alignment.no_clamping",
    "alignment.drives_off",
    "alignment.not_homed",
    "alignment.no_jaw",
    "alignment.no_touch_off",
)
"""Why a machine that was just switched on cuts nothing, in the order in which it is put right."""


def one_word(text: str) -> str:
    return "".join(text.split())


@pytest.mark.long
def test_a_refusal_and_a_stop_that_failed_are_on_the_screen_in_full(tmp_path: Path) -> None:
    text = load("ko")
    first, *others = (one_word(text.problem(Problem(code=code))) for code in MISSING)
    with console(tmp_path, "ko", 80, 24) as terminal:
        trainee = console_at(terminal, "ko")
        trainee.press("5", "f5")
        more = f"+{len(others)} {text('frame.all')}"
        terminal.wait_for(lambda _: more in terminal.row(1), 10.0)
        answer = f"{terminal.row(1).replace(more, '')}{terminal.row(2)}"
        assert one_word(answer) == f"–{first}"
        trainee.press("w")
        terminal.wait_for(lambda shown: all(each in one_word(shown) for each in (first, *others)), 5.0)
        trainee.press("end")
        trainee.sees("messages.close", 5.0)
        trainee.press("w")
        trainee.sees("run_page.checks", 5.0)

        os.kill(simulator_of(terminal), signal.SIGKILL)
        trainee.sees("activity.lost")
        trainee.press("space")
        failed = one_word(f"{text('frame.stop')} {text('frame.not_delivered')}")
        terminal.wait_for(lambda _: one_word(terminal.row(-2)) == failed, 5.0)
        assert one_word(text("run_page.lost.remedy")) in one_word(terminal.text.replace("│", ""))
        assert one_word(text("key.help")) in terminal.row(-1)


def test_a_cut_that_was_killed_with_its_console_is_told_at_the_next_start(tmp_path: Path) -> None:
    killed(begins(tmp_path, "armed", "started", machine="lee-2001-lathe"))
    with console(tmp_path, "en", 160, 48) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("activity.ready", 30.0)
        terminal.wait_for("the run of ring that started on", 5.0)
        assert list((tmp_path / FOLDER).iterdir()) == []


# The pages Controller and Scope at a real terminal, on a served simulator taken for a machine.


@pytest.mark.long
def test_an_engineer_asks_watches_backs_up_and_gathers(serve: Serve, tmp_path: Path) -> None:
    profile = tmp_path / "shop-9.toml"
    text = signed(compact_text("turbo")).replace('name = "turbo-ethernet-lathe"', 'name = "shop-9"')
    assert 'name = "shop-9"' in text
    profile.write_text(text, encoding="utf-8")
    data = tmp_path / "data"
    with serve("--machine", str(profile), "--tcp", "127.0.0.1:0") as simulator:
        link = "tcp:{}:{}".format(*simulator.tcp)
        command = [sys.executable, "-m", "console", "--machine", str(profile), "--link", link, "--data", str(data)]
        with Terminal(command, columns=80, rows=24) as terminal:
            engineer = Trainee(terminal, "en")
            engineer.sees("activity.ready", 30.0)
            engineer.press("0", "d")
            terminal.wait_for("603382", 10.0)
            engineer.press("right", "right", "enter", *"p40", "enter")
            terminal.wait_for(r"P40\s+0", 10.0)
            engineer.press("right", "enter", *"#1j+", "enter")
            terminal.wait_for("jog on page Align", 10.0)
            engineer.press("b")
            terminal.wait_for("Backup written", 40.0)
            engineer.press("f")
            terminal.wait_for("no differences", 40.0)
            engineer.press("0", "o", "g")
            terminal.wait_for("Tool FE um", 20.0)
            engineer.press("x")
            terminal.wait_for("kept as", 10.0)
    (backup,) = (data / "backups").iterdir()
    (kept,) = (data / "scope").iterdir()
    assert backup.name.startswith("shop-9-") and kept.read_text(encoding="utf-8").startswith("# trilobe scope 1")
    assert json.loads((data / "watch" / "shop-9.json").read_text(encoding="utf-8"))["items"] == ["P40"]


# Plain `console` at a real terminal, where the configuration of the lathe says everything else.


OTHER = "turbo-ethernet-lathe"


def test_the_screens_open_on_the_configured_machine_in_its_language(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, file = tmp_path / "lathe", tmp_path / "trilobe" / "config.toml"
    file.parent.mkdir()
    file.write_text(f'schema = 1\ndata = "{data}"\nmachine = "{OTHER}"\nlink = "sim:"\nlanguage = "ko"\n')
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with Terminal([sys.executable, "-m", "console"]) as terminal:
        terminal.wait_for(load("ko")("activity.ready"), 30.0)
        assert load_machine(OTHER).machine.name in terminal.row(0) and "SIM" in terminal.row(0)


# The feed of a console at a real terminal: readers that stall or send garbage, a kill, and `console watch`.


WATCH = [sys.executable, "-m", "console", "watch"]


def joined(data: Path, line: bytes) -> socket.socket:
    (path,) = feeds(data)
    link = connect_feed(path, 20.0)
    link.sendall(line)
    return link


def listed(data: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return completed(["watch", "--list", "--data", str(data), *more], 30.0)


def until(link: socket.socket, activity: str) -> dict[str, Any]:
    """Read states until the console does something."""
    with link.makefile("rb") as stream:
        for line in stream:
            state: dict[str, Any] = json.loads(line)
            if state["activity"] == activity:
                return state
    raise AssertionError("the feed has ended")


@pytest.mark.long
def test_readers_do_not_touch_a_console_and_a_killed_one_leaves_nothing(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        stalled = [joined(tmp_path, b"rate 10\n") for _ in range(3)]
        garbage = joined(tmp_path, b"\x00" * 5000)
        with joined(tmp_path, b"rate 10\n") as reader:
            trainee.switches_on()
            trainee.starts_homing()
            state = until(reader, "homing")
            assert (state["execution"], state["controls"], state["simulated"]) == ("active", True, True)
            trainee.press("space")
            trainee.sees("frame.recover")
            assert until(reader, "stopped")["execution"] == "stopped"
        words = [*WATCH, "--data", str(tmp_path), "--lang", "ko"]
        with Preloaded(words, stdout=subprocess.PIPE, text=True) as watching:
            assert watching.stdout is not None
            assert "SIM" in watching.stdout.readline()
            terminal.signal(signal.SIGKILL)
            assert "콘솔이 끝났습니다" in watching.stdout.read()
        for link in (*stalled, garbage):
            link.close()
    (left,) = feeds(tmp_path)
    assert listed(tmp_path).returncode == 1  # nobody is there
    with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
        trainee = console_at(terminal)
        (path,) = feeds(tmp_path)
        assert path != left
        (line,) = listed(tmp_path, "--json").stdout.splitlines()
        assert json.loads(line)["machine"] == "lee-2001-lathe"
        assert listed(tmp_path, "--machine", "another").stderr.count("lee-2001-lathe") == 1
        trainee.press("ctrl+q")
        assert terminal.wait_exit(20.0) == 0
    assert os.listdir(tmp_path / "feed") == []


@pytest.mark.long
def test_metrics_are_served_on_loopback_while_consoles_come_and_go(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "console", "metrics", "--listen", "127.0.0.1:0", "--data", str(tmp_path)]
    with Preloaded(words, stdout=subprocess.PIPE, text=True) as serving:
        assert serving.stdout is not None
        address = serving.stdout.readline().split()[-1]
        try:
            with urlopen(address, timeout=20.0) as answer:
                assert answer.read().decode().splitlines()[-1] == "trilobe_consoles 0.0"
                assert answer.headers["Content-Type"].startswith("text/plain; version=0.0.4")
            with socket.create_connection(("127.0.0.1", int(address.split(":")[2].split("/")[0])), 20.0):
                with console(tmp_path, "en", 80, 24, short_ways=True) as terminal:
                    console_at(terminal)
                    until_s, found = time.monotonic() + 20.0, ""
                    while 'trilobe_parts_total{machine="lee-2001-lathe"' not in found:
                        assert time.monotonic() < until_s, found
                        with urlopen(address, timeout=20.0) as answer:  # who asks nothing holds up nobody
                            found = answer.read().decode()
        finally:
            serving.terminate()
