"""Where a part is high, from jaw 1: the same wherever it is shown, of a file that counts from jaw 1."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.__main__ import main
from console.session.data.run_reader import RecordedPart
from console.session.learning.evaluated_part import evaluated_part
from console.session.learning.imported import examined
from console.session.station.state import MeasuredPart, StationState
from console.tui.inspecting.comparison import compared
from console.tui.pages.inspect_lines import phase_from_jaw_deg
from drivers.cutting.strategy import Strategy
from profiles.store import load_job
from tests.console.commands import JobFile

PAST_DEG = 13.36
"""How far the high places are past the jaws, as the spindle counts."""


def file(folder: Path, direction: str, *head: str) -> Path:
    """A part off the axis of the gauge; at angle 0 of the gauge is jaw 1, ccw counts against the spindle."""
    angle_deg = np.arange(720) / 2.0
    way = -1.0 if direction == "ccw" else 1.0
    past_deg = way * angle_deg
    deviation_um = 4.0 * np.cos(3.0 * np.radians(past_deg - PAST_DEG)) + 7.0 * np.sin(np.radians(past_deg))
    lines = ["# state: free", f"# direction: {direction}", "# start_mark: jaw 1", *head, "angle_deg,deviation_um"]
    path = folder / "part.csv"
    path.write_text(
        "\n".join([*lines, *(f"{a},{d!r}" for a, d in zip(angle_deg, deviation_um.tolist(), strict=True))])
    )
    return path


def near(found_deg: float | None) -> None:
    assert found_deg is not None
    assert (found_deg - PAST_DEG + 60.0) % 120.0 - 60.0 == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize("upr", [None, 15.0])
@pytest.mark.parametrize("direction", ["cw", "ccw"])
@pytest.mark.parametrize("jaw_1_deg", [0.0, 261.65, 271.8])
def test_table_and_plot_count_from_jaw_1(
    jaw_1_deg: float, direction: str, upr: float | None, tmp_path: Path
) -> None:
    job = replace(load_job("lee-2001-experiment-1").job, lobe_phase_deg=jaw_1_deg, lobe_past_jaw_deg=0.0)
    found = examined(file(tmp_path, direction), job, {}, simulated=False)
    assert found.result is not None
    part = MeasuredPart(
        job=job, strategy=Strategy.NONE, trace=found.turn, result=found.result, jaw_1_deg=job.jaw_1_deg
    )
    shown = compared(StationState(measured=part))
    assert shown is not None
    if upr is not None:  # looked at with another filter it is evaluated anew
        shown = compared(StationState(measured=part), replace(shown.looked, filter_upr=upr))
        assert shown is not None
    past_deg = phase_from_jaw_deg(shown.last, 3)
    assert past_deg == pytest.approx(PAST_DEG, abs=0.01)
    highest = float(shown.last.angle_deg[int(np.argmax(shown.last.profile_um))])
    near(highest - part.jaw_1_deg)  # the plot has its mark "1" at jaw 1
    # The centre, too: 7 um towards 90 deg past jaw 1.
    towards_deg = np.degrees(np.arctan2(found.result.centre_y_um, found.result.centre_x_um))
    assert (towards_deg - jaw_1_deg - 90.0 + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.01)


def recorded(content: bytes, jaw_1_deg: float) -> RecordedPart:
    nothing: dict[str, Any] = dict.fromkeys(
        ("tolerance_um", "passed", "diameter_mm", "nominal_diameter_mm", "diameter_tolerance_um", "lobe_um_pp")
    )
    data = {"jaw_1_deg": jaw_1_deg, "filter_upr": 50.0}
    return RecordedPart(
        number=1, at=datetime.now(UTC), part="", product=True, ront_um=8.0, data=data, trace=content, **nothing
    )


@pytest.mark.parametrize("direction", ["cw", "ccw"])
def test_report_and_records_count_from_jaw_1(direction: str, tmp_path: Path) -> None:
    part = recorded(file(tmp_path, direction).read_bytes(), 261.65)
    printed = evaluated_part(part, {})
    assert printed is not None and printed.jaw_1_deg is not None
    way = -1.0 if direction == "ccw" else 1.0
    near(way * (float(printed.turn.angle_deg[int(np.argmax(printed.profile_um))]) - printed.jaw_1_deg))
    trace = evaluated_part(part, {}, on_spindle=True)
    assert trace is not None
    assert trace.jaw_1_deg == 261.65
    near(float(trace.turn.angle_deg[int(np.argmax(trace.profile_um))]) - trace.jaw_1_deg)


@pytest.mark.parametrize("direction", ["cw", "ccw"])
def test_the_command_counts_from_jaw_1(
    direction: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], job_file: JobFile
) -> None:
    job = str(job_file(lobe_phase_deg="261.65"))
    assert main(("roundness", str(file(tmp_path, direction)), "--job", job, "--json")) == 0
    listed = json.loads(capsys.readouterr().out)
    (lobe,) = (each for each in listed["harmonics"] if each["n"] == 3)
    assert lobe["past_jaw_1_deg"] == pytest.approx(PAST_DEG, abs=0.01)


def test_the_report_counts_from_jaw_1_of_the_part_as_records_does(tmp_path: Path) -> None:
    """Jaw 1 is where it was for the cut of the part, whatever the set-up of its run has."""
    part, setup = recorded(file(tmp_path, "cw").read_bytes(), 261.65), {"jaw_1_deg": 12.63}
    printed, shown = evaluated_part(part, setup), evaluated_part(part, setup, on_spindle=True)
    assert printed is not None and shown is not None and shown.jaw_1_deg == 261.65
    found = [each.past_jaw_1_deg(printed.jaw_1_deg or 0.0) for each in printed.result.harmonics if each.n == 3]
    on_spindle = [each.past_jaw_1_deg(261.65) for each in shown.result.harmonics if each.n == 3]
    assert found == pytest.approx(on_spindle, abs=1e-6)
