"""A file whose unit or size is wrong by its header judges no part, teaches nothing and corrects no tool."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.session.guide.refusals import refused
from console.session.guide.situation import Situation
from console.session.learning.imported import examined
from console.session.station.state import MeasuredPart, StationState
from console.text.catalogue import load
from console.tui.inspecting.comparison import compared
from console.tui.lines import plain
from console.tui.pages.inspect_lines import result_lines
from drivers.cutting.strategy import Strategy
from profiles.calibration.lobe import find_lobe
from profiles.store import load_job, load_machine
from profiles.traces import read_trace
from tests.console.commands import Console, JobFile

JOB = "lee-2001-experiment-1"
LOBE_UM = 41.7
PLACED = ("# state: free", "# direction: spindle", "# start_mark: spindle index")


def file(folder: Path, column: str, *head: str, in_mm: bool = False, lobe_um: float = LOBE_UM) -> Path:
    """A part with a lobe of 41.7 um, its numbers in um or mm whatever the header says."""
    angle_deg = np.arange(720) / 2.0
    deviation = 0.5 * lobe_um * np.cos(3.0 * np.radians(angle_deg - 20.0)) / (1000.0 if in_mm else 1.0)
    rows = [f"{a},{d!r}" for a, d in zip(angle_deg, deviation.tolist(), strict=True)]
    path = folder / "part.csv"
    path.write_text("\n".join([*PLACED, *head, f"angle_deg,{column}", *rows]))
    return path


@pytest.mark.parametrize(
    ("column", "in_mm", "seen", "meant", "right"),
    [
        ("deviation_um", True, "0.0416 um", "41.6 um", "deviation_mm"),
        ("deviation_mm", False, "41596 um", "41.6 um", "deviation_um"),
    ],
)
def test_a_part_in_another_unit_than_its_header_is_not_judged(
    column: str, in_mm: bool, seen: str, meant: str, right: str, console: Console, tmp_path: Path
) -> None:
    """A filter of 50 UPR passes 99.75 % of three lobes: 41.6 of 41.7 um."""
    path = file(tmp_path, column, in_mm=in_mm)
    for more in ((), ("--fail-out-of-tolerance",)):
        said = console("roundness", str(path), "--job", JOB, *more)
        assert said.code == 1 and said.out == "" and said.err.count("\n") == 1
        for word in (seen, meant, right, "unit", "units_checked"):
            assert word in said.err
    assert "단위" in console("roundness", str(path), "--job", JOB, "--lang", "ko").err
    found = examined(path, load_job(JOB).job, {}, simulated=False)
    assert [each.limit for each in found.problems] == [meant]
    assert not found.ready and found.result is None
    (reason,) = find_lobe(read_trace(path), load_job(JOB).job).reasons
    assert reason.code.startswith("trace.unit_doubtful")
    kept = console("calibrate", "lobe", str(path), "--job", JOB, "--keep")
    assert kept.code == 1 and "unit" in kept.err


def test_a_unit_that_may_be_right_is_taken(console: Console, tmp_path: Path) -> None:
    job = load_job(JOB).job
    for lobe_um in (0.6, 2.0, LOBE_UM, 800.0):
        assert examined(file(tmp_path, "deviation_um", lobe_um=lobe_um), job, {}, simulated=False).ready
    assert examined(file(tmp_path, "deviation_mm", in_mm=True), job, {}, simulated=False).ready
    ideal = file(tmp_path, "deviation_um", "# simulated: yes", lobe_um=0.08)
    assert examined(ideal, job, {}, simulated=True).ready, "an ideal lathe of the simulator"
    checked = file(tmp_path, "deviation_um", "# units_checked: yes", lobe_um=0.08)
    assert examined(checked, job, {}, simulated=False).ready
    # A glass sphere is nobody's part: without a job it is measured as it is.
    assert console("roundness", str(file(tmp_path, "deviation_um", lobe_um=0.08))).code == 0


@pytest.mark.parametrize(
    ("radius_mm", "code"), [(66.8, "lobe.diameter_stated"), (40.0, "lobe.other_size"), (34.2, "lobe.other_size")]
)
def test_a_size_that_is_not_of_the_job_moves_no_tool(
    radius_mm: float, code: str, console: Console, tmp_path: Path, job_file: JobFile
) -> None:
    """The job leaves a radius of 33.4 mm."""
    target = load_job(JOB).job
    job_path = job_file(diameter_mm=str(66.8 + 2.0 * target.depth_of_cut_mm))
    path = file(tmp_path, "deviation_um", f"# radius_mm: {radius_mm}")
    said = console("roundness", str(path), "--job", str(job_path))
    assert said.code == 0
    assert "into the part" not in said.out and f"{radius_mm:.3f} mm" in said.err and "33.400 mm" in said.err
    assert ("diameter" in said.err) is (code == "lobe.diameter_stated")
    assert console("roundness", str(path), "--job", str(job_path), "--json").json["tool_offset_um"] is None

    job = replace(load_job(str(job_path)).job, diameter_tolerance_um=20.0)
    found = examined(path, job, {}, simulated=False)
    assert found.result is not None
    part = MeasuredPart(
        job=job,
        strategy=Strategy.NONE,
        trace=found.turn,
        result=found.result,
        jaw_1_deg=job.jaw_1_deg,
        diameter_mm=2.0 * radius_mm,
    )
    state = StationState(measured=part)
    now = Situation(state=state, work=None, machine=load_machine("lee-2001-lathe").machine)
    assert [each.code for each in refused("inspect.offset", now)] == [code]
    shown = compared(state)
    assert shown is not None
    for language in ("en", "ko"):
        words = plain(result_lines(shown, False, load(language), 60, 40))
        assert f"{radius_mm:.3f}" in words and not re.search(r"\+\d{3}", words)
    assert part.diameter_passes is (None if code == "lobe.diameter_stated" else False)


def points(tmp_path: Path, unit: float, *more: str, x: float = 0.0) -> Path:
    """Points of a part of D 52 mm, written in `unit` (1: mm), its centre at x."""
    path = tmp_path / "points.csv"
    angles = np.radians(np.arange(360.0))
    distance = 26.0 + 0.5e-3 * LOBE_UM * np.cos(3.0 * angles)
    rows = zip(unit * (distance * np.cos(angles) + x), unit * distance * np.sin(angles), strict=True)
    path.write_text("\n".join([*more, "x_mm,y_mm", *(f"{first:.9g},{second:.9g}" for first, second in rows)]))
    return path


@pytest.mark.parametrize(("unit", "seen"), [(1e-3, "D 0.052 mm"), (1e2, "D 5200 mm")])
def test_points_in_another_unit_than_mm_are_doubted(
    unit: float, seen: str, console: Console, tmp_path: Path
) -> None:
    path = points(tmp_path, unit)
    said = console("roundness", str(path))
    assert said.code == 0 and seen in said.err and "x_mm,y_mm" in said.err and "deviation" not in said.err
    refused = console("roundness", str(path), "--job", JOB)
    assert refused.code == 1 and seen in refused.err and "deviation" not in refused.err
    checked = console("roundness", str(points(tmp_path, unit, "# units_checked: yes")))
    assert checked.code == 0 and "probably" not in checked.err


def test_points_in_mm_are_taken_and_their_centre_is_no_eccentricity(console: Console, tmp_path: Path) -> None:
    said = console("roundness", str(points(tmp_path, 1.0, x=1.5)))
    assert said.code == 0 and "probably" not in said.err
    assert "1.5000" in said.out and "eccentricity" not in said.out and "-0.0000" not in said.out
