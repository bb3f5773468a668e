"""A whole job on the bundled machine with the other controller: the part gets as round as behind the paper's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.console.commands import Console, JobFile
from tests.system.lathe_sites import compact_text


def takes_the_lobe_away(result: dict[str, Any]) -> None:
    assert (result["machine"], result["simulated"]) == ("turbo-ethernet-lathe", True)
    assert (result["collisions"], result["warnings"]) == ([], [])
    assert result["before"]["RONt_um"] == pytest.approx(55.0, abs=0.3)
    assert result["after"]["RONt_um"] < 1.0
    assert result["spindle_rpm"] == pytest.approx(1000, rel=1e-4)


def shorter(family: str, folder: Path) -> str:
    """Save the bundled machine of a family with short ways."""
    path = folder / f"{family}.toml"
    path.write_text(compact_text(family), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("strategy", ["cam", pytest.param("timebase", marks=pytest.mark.long)])
@pytest.mark.long
def test_a_turbo_takes_the_lobe_away_in_each_way_that_keeps_the_angle(
    console: Console, job_file: JobFile, tmp_path: Path, strategy: str
) -> None:
    """By the table on the bundled machine as it is."""
    path = job_file(cut_length_mm="0.5", roundness_tolerance_um="10.0")
    machine = "turbo-ethernet-lathe" if strategy == "cam" else shorter("turbo", tmp_path)
    words = ("--sim", "--json", "--machine", machine, "--strategy", strategy)
    takes_the_lobe_away(console("run", str(path), *words).json)


@pytest.mark.long
def test_both_controllers_leave_the_same_part_by_times_that_are_planned(
    console: Console, job_file: JobFile, tmp_path: Path
) -> None:
    path = str(job_file(cut_length_mm="0.5", roundness_tolerance_um="10.0"))
    parts = [
        console("run", path, "--sim", "--json", "--machine", shorter(family, tmp_path), "--strategy", "pvt").json
        for family in ("pmac", "turbo")
    ]
    paper, turbo = parts
    takes_the_lobe_away(turbo)
    for part in ("before", "after"):
        assert turbo[part]["RONt_um"] == pytest.approx(paper[part]["RONt_um"], abs=0.1)
    assert turbo["tool_error_um"] == pytest.approx(paper["tool_error_um"], abs=0.1)
