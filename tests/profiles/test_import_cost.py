"""Profiles are read at start-up and in every headless command, so they bring nothing heavy with them."""

import subprocess
import sys

import pytest

HEAVY = ("scipy", "control", "matplotlib", "tomlkit")


@pytest.mark.parametrize(
    ("modules", "unwanted"),
    [
        ("profiles.job, profiles.machine, profiles.store, profiles.rules", (*HEAVY, "numpy")),
        ("profiles.roundness, profiles.traces, profiles.compensation, profiles.servo", HEAVY),
    ],
)
def test_imports(modules: str, unwanted: tuple[str, ...]) -> None:
    code = f"import sys, {modules}; print(*(name for name in {unwanted!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
