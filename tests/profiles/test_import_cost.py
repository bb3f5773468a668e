"""Profiles are read at start-up and in every headless command, so they bring nothing heavy with them."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import profiles

HEAVY = ("scipy", "control", "matplotlib", "tomlkit")


@pytest.mark.parametrize(
    ("modules", "unwanted"),
    [
        ("profiles.job, profiles.machine, profiles.store, profiles.rules", (*HEAVY, "numpy")),
        ("profiles.roundness, profiles.traces, profiles.compensations.path, profiles.axis.servo", HEAVY),
    ],
)
def test_imports(modules: str, unwanted: tuple[str, ...]) -> None:
    code = f"import sys, {modules}; print(*(name for name in {unwanted!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


SCRIPT = """
import sys
import profiles

assert "numpy" not in sys.modules and "profiles.roundness" not in sys.modules
assert {"roundness", "traces", "servo"} <= set(dir(profiles)) and not hasattr(profiles, "nothing")
print(f"{profiles.roundness.evaluate(range(0, 360, 60), [1, 0, 1, 0, 1, 0], None).ront_um:.9f}")
for name in profiles.__all__:
    assert getattr(profiles, name).__name__.startswith("profiles.")
"""


def test_a_plain_script_needs_one_import() -> None:
    """What it may name is what type checkers are told."""
    stub = Path(profiles.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    assert re.findall(r"^    \"(\w+)\",$", stub, re.MULTILINE) == profiles.__all__
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == ("1.000000000", "")
