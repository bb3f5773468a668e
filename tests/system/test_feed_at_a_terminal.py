"""The feed of a console at a real terminal: readers that stall or send garbage, a kill, and `console watch`."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

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
