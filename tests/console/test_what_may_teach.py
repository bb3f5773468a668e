"""Which part may teach the next one: one rule for the page Inspect, `console learn` and `console run --learn`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.console.commands import Console, JobFile

BLIND = """\
schema = 1
source = "a gauge without a mark, and a lobe 10 % larger than the job says"
[chuck]
lobe_factor = 1.1
[gauge]
start_mark = "unknown"
"""


@pytest.fixture
def ring(job_file: JobFile) -> str:
    """Experiment 1 over a few turns."""
    return str(job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1"))


def test_parts_in_a_row_learn_nothing_from_a_gauge_that_does_not_know_its_angle(
    console: Console, ring: str, close: tuple[str, str], tmp_path: Path
) -> None:
    plant = tmp_path / "blind.toml"
    plant.write_text(BLIND, encoding="utf-8")
    words = (*close, "--sim", "--plant", str(plant), "--seed", "4", "--strategy", "cam", "--learn", "2")
    said = console("run", ring, *words)
    assert said.code == 1
    assert "the phase of the trace is unknown" in said.err
    # The gauge has shown it on the part in front of all others: none is cut that learns.
    assert "SIM  before  " in said.out and "SIM  air  " not in said.out and "SIM  part  " not in said.out
