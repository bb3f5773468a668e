"""A stream that is closed or full, and a Ctrl-C that comes early: one line at most, and a true exit code."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

FULL = Path("/dev/full")
needs_full = pytest.mark.skipif(not FULL.exists(), reason="no device that is always full")


def shell(words: str, *, unbuffered: bool = False) -> subprocess.CompletedProcess[str]:
    command = f"{sys.executable} -m console {words}"
    environment = {**os.environ, "PYTHONUNBUFFERED": "1" if unbuffered else "", "LC_ALL": "C.UTF-8"}
    return subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=30, env=environment)


@pytest.mark.parametrize("closed", [pytest.param(">&-", marks=pytest.mark.long), "2>&-", "<&- >&- 2>&-"])
@pytest.mark.first(1)
def test_a_closed_stream_changes_nothing_else(closed: str) -> None:
    done = shell(f"jobs {closed}")
    assert (done.returncode, done.stderr) == (0, "")
    assert ("lee-2001-experiment-1" in done.stdout) == (closed == "2>&-")
    assert shell(f"preview no-such-job {closed}").returncode == 1
    assert shell(f"frobnicate {closed}").returncode == 2


@needs_full
@pytest.mark.parametrize("unbuffered", [False, True])
@pytest.mark.parametrize(
    "words", ["jobs", "--help", "jobs --help", "predict lee-2001-experiment-1 --json", "--version"]
)
@pytest.mark.first(3)
def test_a_full_disk_is_one_line(words: str, unbuffered: bool) -> None:
    done = shell(f"{words} >{FULL}", unbuffered=unbuffered)
    assert done.returncode == 1
    assert done.stderr == "console: cannot write the output (No space left on device)\n"


def test_an_output_that_only_reads_is_one_line() -> None:
    done = shell("jobs 1<&0 0</dev/null 1<&0")
    assert (done.returncode, done.stderr) == (1, "console: cannot write the output (Bad file descriptor)\n")


@needs_full
def test_wrong_usage_stays_wrong_usage_on_a_full_disk() -> None:
    done = shell(f"frobnicate >{FULL}")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "module", ["console.text.catalogue", "console.cli.parser", "console.cli.part.jobs", "tomllib"]
)
def test_a_ctrl_c_during_the_imports_is_one_line(module: str) -> None:
    interrupted = f"""
import sys
class Interrupt:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
from console.__main__ import main
sys.exit(main(["jobs"]))
"""
    environment = {**os.environ, "LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        [sys.executable, "-c", interrupted], capture_output=True, text=True, timeout=30, env=environment
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "console: ended by SIGINT; this command was not moving anything\n"


def test_the_entry_point_imports_nothing_of_the_project() -> None:
    show = (
        "import sys, console.__main__; print(*(name for name in sys.modules"
        " if name.split('.')[0] in ('profiles', 'drivers', 'console')))"
    )
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.split() == ["console", "console.__main__"]
