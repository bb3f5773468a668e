"""The feed of a console at a real terminal: readers that stall or send garbage, a kill, and `console watch`."""

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

from console.session.feed.place import connected, feeds
from tests.preloaded import Preloaded, completed
from tests.trainee import console, console_at

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

WATCH = [sys.executable, "-m", "console", "watch"]


def joined(data: Path, line: bytes) -> socket.socket:
    (path,) = feeds(data)
    link = connected(path, 20.0)
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
