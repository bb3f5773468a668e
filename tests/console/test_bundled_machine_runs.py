"""A whole job on the bundled machine with the other controller: the part gets as round as behind the paper's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Console = Callable[..., Any]
JobFile = Callable[..., Path]


@pytest.mark.parametrize("strategy", ["pvt", "cam", "timebase"])
def test_a_turbo_takes_the_lobe_away_in_each_way_that_keeps_the_angle(
    console: Console, job_file: JobFile, strategy: str
) -> None:
    path = job_file(cut_length_mm="0.5")
    words = ("--sim", "--json", "--machine", "turbo-ethernet-lathe", "--strategy", strategy)
    result = console("run", str(path), *words).json
    assert (result["machine"], result["simulated"]) == ("turbo-ethernet-lathe", True)
    assert (result["collisions"], result["warnings"]) == ([], [])
    assert result["before"]["RONt_um"] == pytest.approx(55.0, abs=0.3)
    assert result["after"]["RONt_um"] < 1.0
    assert result["spindle_rpm"] == pytest.approx(1000, rel=1e-4)


def test_both_controllers_leave_the_same_part(console: Console, job_file: JobFile) -> None:
    path = str(job_file(cut_length_mm="0.5"))
    parts = [
        console("run", path, "--sim", "--json", "--machine", machine).json
        for machine in ("lee-2001-lathe", "turbo-ethernet-lathe")
    ]
    paper, turbo = parts
    for part in ("before", "after"):
        assert turbo[part]["RONt_um"] == pytest.approx(paper[part]["RONt_um"], abs=0.1)
    assert turbo["tool_error_um"] == pytest.approx(paper["tool_error_um"], abs=0.1)
