"""Commands that run until somebody ends them, ended as a service manager does: cleanly, with a line in the log."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from console.session.feed.observed_state import ObservedState
from console.session.feed.server import FeedServer
from console.session.program_log import FILE, FOLDER
from console.session.station.state import Activity, StationState
from profiles.store import load_machine
from tests.preloaded import Preloaded

pytestmark = [pytest.mark.system, pytest.mark.timeout(60)]

MACHINE = load_machine("lee-2001-lathe").machine
STATE = StationState(activity=Activity.READY, machine=MACHINE.name)

NOBODY = "127.0.0.1:1"  # nobody listens there
SERVICES = {
    "ship": ("--shop", "host=127.0.0.1 port=1 dbname=shop sslmode=disable"),
    "mqtt": ("--broker", NOBODY, "--sim"),
    "mtconnect": ("--listen", "127.0.0.1:0"),
    "metrics": ("--listen", "127.0.0.1:0"),
    "watch": (),
    "simulator": ("--pty",),
}
STUDY = """
schema = 1
jobs = ["lee-2001-experiment-1"]
machines = ["lee-2001-lathe"]
plants = ["realistic"]
strategies = ["pvt"]
seeds = [1, 2, 3]
"""


@contextmanager
def begun(name: str, *words: str, data: Path) -> Iterator[Preloaded]:
    """Start a command; wait for the first line that it says."""
    command = [sys.executable, "-m", "console", name, *words, "--data", str(data)]
    with Preloaded(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline()
            yield process
        finally:
            process.kill()


@pytest.fixture
def fed(tmp_path: Path) -> Iterator[Path]:
    """A data folder in which a console publishes its state."""
    server = FeedServer(tmp_path, lambda: ObservedState(state=STATE, machine=MACHINE, now_s=0.0))
    server.launch()
    yield tmp_path
    server.close()


def last_line(data: Path) -> str:
    return (data / FOLDER / FILE).read_text(encoding="utf-8").splitlines()[-1]


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_that_is_told_to_end_has_ended_well_and_the_log_says_by_what(name: str, fed: Path) -> None:
    with begun(name, *SERVICES[name], data=fed) as process:
        process.send_signal(signal.SIGTERM)
        out, _ = process.communicate(timeout=30.0)
        assert process.returncode == 0
    assert "Traceback" not in out
    assert re.search(r" INFO +\d+ end  SIGTERM, exit code 0  trilobe \d", last_line(fed))


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGINT])
def test_other_signals_are_told_apart(number: signal.Signals, tmp_path: Path) -> None:
    with begun("metrics", *SERVICES["metrics"], data=tmp_path) as process:
        process.send_signal(number)
        assert process.wait(30.0) == 0
    assert f"end  {number.name}, exit code 0" in last_line(tmp_path)


def test_a_hangup_that_is_ignored_stays_ignored(tmp_path: Path) -> None:
    """As under `nohup`; the program itself, since a copy has its signals set back."""
    words = [sys.executable, "-m", "console", "metrics", *SERVICES["metrics"], "--data", str(tmp_path)]
    out = subprocess.PIPE
    with subprocess.Popen(["nohup", *words], stdout=out, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        process.send_signal(signal.SIGHUP)
        process.send_signal(signal.SIGTERM)
        assert process.wait(30.0) == 0
    assert "end  SIGTERM, exit code 0" in last_line(tmp_path)


@pytest.mark.long
def test_a_study_that_is_told_to_end_keeps_what_it_has_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "table.toml").write_text(STUDY, encoding="utf-8")
    with begun("study", str(tmp_path / "table.toml"), "--workers", "1", data=tmp_path) as process:
        process.send_signal(signal.SIGTERM)
        out, _ = process.communicate(timeout=30.0)
        assert process.returncode == 1
    assert "SIGTERM" in out and "Traceback" not in out
    assert "end  SIGTERM, exit code 1" in last_line(tmp_path)
