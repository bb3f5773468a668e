"""The tests themselves are run by copies of a process: each once, whatever one of them does to its process."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PLUGIN = """
from tests.side_by_side import add_option as pytest_addoption, pytest_runtestloop
"""
TESTS = """
import os, pytest, tempfile
from pathlib import Path

HERE = Path(__file__).parent

@pytest.fixture(scope="module")
def shared():
    with (HERE / "made").open("a") as file: file.write("x")
    yield
    with (HERE / "taken away").open("a") as file: file.write("x")

@pytest.mark.parametrize("number", range(30))
def test_holds(number, tmp_path):
    (tmp_path / "mine").touch(exist_ok=False)
    (HERE / f"ran {number}").touch(exist_ok=False)

def test_fails():
    print("said before it failed")
    assert "this" == "that"

def test_ends_its_process():
    os.abort()

def test_is_left_out():
    pytest.skip("not here")

@pytest.mark.parametrize("number", range(3))
def test_with_the_same(shared, number):
    pass

def test_tears_down_badly(request):
    request.addfinalizer(lambda: 1 / 0)
"""


def run(folder: Path, *words: str) -> str:
    """Return what pytest says of the tests above, run with these words."""
    (folder / "conftest.py").write_text(PLUGIN, encoding="utf-8")
    (folder / "test_some.py").write_text(TESTS, encoding="utf-8")
    (folder / "pytest.ini").write_text(
        "[pytest]\naddopts = -q -p no:xdist -p no:cacheprovider\n", encoding="utf-8"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    environment.pop("PYTEST_ADDOPTS", None)
    command = [sys.executable, "-m", "pytest", *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=50)
    assert done.returncode == pytest.ExitCode.TESTS_FAILED, done.stdout + done.stderr
    return done.stdout


def test_each_test_is_run_once_and_what_ends_its_process_fails(tmp_path: Path) -> None:
    said = run(tmp_path, "-n", "3")
    assert re.search(r"^2 failed, 34 passed, 1 skipped, 1 error in ", said, re.MULTILINE), said
    assert len(list(tmp_path.glob("ran *"))) == 30
    assert (tmp_path / "made").read_text() == (tmp_path / "taken away").read_text() == "x"
    assert "said before it failed" in said
    assert "assert 'this' == 'that'" in said
    assert "test_ends_its_process" in said
    assert "the test has ended its process, with status 134" in said or "with status 6" in said
    assert "ERROR test_some.py::test_tears_down_badly - ZeroDivisionError" in said


def test_after_the_first_failure_no_more_are_begun_where_that_is_asked_for(tmp_path: Path) -> None:
    said = run(tmp_path, "-n", "2", "-x", "-k", "fails or holds")
    assert "stopping after 1 failures" in said, said
