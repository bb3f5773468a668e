"""`console jobs`, `preview`, `program` and `roundness`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.console.commands import Console


def test_jobs_lists_what_is_bundled_with_its_conditions(console: Console) -> None:
    jobs = {job["name"]: job for job in console("jobs", "--json").json["jobs"]}
    one = jobs["lee-2001-experiment-1"]
    assert (one["diameter_mm"], one["wall_thickness_mm"], one["lobe_error_um_pp"]) == (52, 2.5, 55)
    assert {"chucking_force_n", "feed_mm_per_rev", "cut_length_mm"} <= set(one["assumed"])
    assert "lee-2001-experiment-2" in console("jobs").out


def test_a_job_in_the_own_folder_is_listed_and_a_broken_one_says_why(console: Console, data_folder: Path) -> None:
    folder = data_folder / "trilobe" / "jobs"
    folder.mkdir(parents=True)
    (folder / "broken.toml").write_text("name = 3")
    said = console("jobs")
    assert said.code == 0
    assert "broken" in said.out
    listed = {job["name"]: job for job in console("jobs", "--json").json["jobs"]}
    assert listed["broken"]["problems"]


def test_preview_states_the_servo_of_the_paper_and_the_sampled_loop(console: Console) -> None:
    seen = console("preview", "lee-2001-experiment-1", "--json").json
    assert seen["eq9"]["gain"] == pytest.approx(0.7455, abs=1e-3)
    assert seen["eq9"]["phase_rad"] == pytest.approx(-0.7823, abs=1e-3)
    assert seen["eq9"]["bandwidth_hz"] == pytest.approx(55.24, abs=0.1)
    assert seen["eq9"]["residual_um_pp"] == pytest.approx(38.8, abs=0.2)
    assert seen["sampled_loop"]["gain"] == pytest.approx(0.885, abs=1e-3)
    assert seen["sampled_loop"]["phase_rad"] == pytest.approx(-0.903, abs=2e-3)
    assert seen["command"]["amplitude_um"] == pytest.approx(27.5 / 0.8855, abs=0.02)
    assert seen["grip_margin_n"] > 0
    assert "um p-p" in console("preview", "lee-2001-experiment-1", "--lang", "ko").out


def test_the_paper_program_is_printed_as_it_will_be_sent(console: Console) -> None:
    said = console("program", "lee-2001-experiment-1", "--strategy", "paper")
    assert "TA10 TS10" in said.out
    assert "P500=275" in said.out
    assert "X-10000" in said.out
    assert "20 ms" in said.err
    result = console("program", "lee-2001-experiment-2", "--strategy", "paper", "--json").json
    assert "P500=165" in result["program"]
    assert "X300" in result["program"]
    assert result["spindle_rpm"] == pytest.approx(500)


def trace_file(tmp_path: Path, angle_deg: np.ndarray, deviation_um: np.ndarray, head: str = "") -> Path:
    path = tmp_path / "trace.csv"
    rows = "\n".join(f"{a!r},{d!r}" for a, d in zip(angle_deg.tolist(), deviation_um.tolist(), strict=True))
    path.write_text(f"{head}angle_deg,deviation_um\n{rows}\n")
    return path


def test_roundness_of_a_three_lobe_with_eccentricity(console: Console, tmp_path: Path) -> None:
    """27.5 sin 3t + 12 cos t - 7 sin t measures 55 um with any circle; the crest of sin 3t is at 30 deg."""
    angle = np.arange(3600) / 10
    t = np.radians(angle)
    path = trace_file(tmp_path, angle, 27.5 * np.sin(3 * t) + 12 * np.cos(t) - 7 * np.sin(t), "# state: free\n")
    result = console("roundness", str(path), "--filter", "none", "--json").json
    assert result["RONt_um"] == pytest.approx(55, abs=1e-6)
    assert result["RONq_um"] == pytest.approx(19.445436, abs=1e-6)
    assert result["eccentricity_um"] == pytest.approx(np.hypot(12, 7), abs=1e-6)
    assert (result["filter_upr"], result["state"], result["reference_circle"]) == (None, "free", "LSC")
    third = next(h for h in result["harmonics"] if h["n"] == 3)
    assert (third["amplitude_um"], third["phase_deg"]) == (pytest.approx(27.5), pytest.approx(30))
    filtered = console("roundness", str(path), "--filter", "15", "--json").json
    assert filtered["RONt_um"] == pytest.approx(53.50, abs=0.01)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ()),
        ("a,b\n1,2\n", ("trace.csv:1",)),
        ("angle_deg,deviation_um\n0,nan\n", ("trace.csv:2", "nan")),
        ("angle_deg,deviation_um\n0,1\n5,abc\n", ("trace.csv:3", "abc")),
        ("angle_deg,deviation_um\n0,1\n", ("1",)),
    ],
)
def test_a_trace_that_is_none_is_refused_with_its_line(
    console: Console, tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    path = tmp_path / "trace.csv"
    path.write_text(text)
    said = console("roundness", str(path))
    assert said.code == 1
    assert said.out == ""
    assert "trace.csv" in said.err
    for word in words:
        assert word in said.err


def test_the_version_is_stated(console: Console) -> None:
    said = console("--version")
    assert said.code == 0
    assert said.out.startswith("trilobe 0.")
    stated = console("--version", "--json").json
    assert stated == {"schema": 1, "name": "trilobe", "version": said.out.split()[1]}


def test_json_may_stand_before_the_command(console: Console) -> None:
    assert console("--json", "jobs").json == console("jobs", "--json").json
