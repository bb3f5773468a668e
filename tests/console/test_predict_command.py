"""`console predict` and `console preview`: the same in words and JSON; what is assumed is said."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.cutting.planning import Strategy
from drivers.preview.band import Band, predicted_band
from drivers.preview.outlook import outlook
from drivers.preview.preview import ProgramInput, program_of, underway
from drivers.simulator.plant.presets import plant_named
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import evaluate
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.drivers.conftest import connected


def test_json_has_the_error_over_angle_and_z(console: Console) -> None:
    seen = console("predict", "lee-2001-experiment-1", "--json").json
    error = np.array(seen["error_um"])
    assert error.shape == (len(seen["z_mm"]), len(seen["angle_deg"])) == (7, 360)
    assert seen["error_um_pp"] == pytest.approx(np.ptp(error, axis=1).tolist())
    assert seen["angle_deg"][int(error[0].argmax())] % 120 == 90
    assert (seen["cut"]["mechanism"], seen["cut"]["high_at_jaws"]) == ("spring_back", True)
    assert seen["cut"]["measured_um_pp"] == 55.0
    assert seen["model"]["matching_force_n"] == pytest.approx(7475, abs=1)
    assert (seen["scaled_to"]["source"], seen["scaled_to"]["found_um_pp"]) == ("measured", 55.0)
    assert seen["cut"]["um_pp"] == pytest.approx(55.0)
    assert seen["model"]["um_pp"] == pytest.approx(8.19, abs=0.01)
    assert seen["clamping"]["minimum_n"] < seen["clamping"]["at_rest_n"] < seen["clamping"]["maximum_n"]
    assert seen["process"]["force"]["main_n"] == pytest.approx(7.40, abs=0.005)
    minded = [finding["code"] for finding in seen["findings"] if finding["severity"] != "ok"]
    assert minded == ["rule.second_pass"]


@pytest.mark.parametrize(("language", "words"), [("en", "springs back"), ("ko", "탄성 복원")])
def test_people_read_the_same_numbers(console: Console, language: str, words: str) -> None:
    seen = console("predict", "lee-2001-experiment-1", "--json").json
    said = console("predict", "lee-2001-experiment-1", "--lang", language)
    assert said.code == 0
    for number in (
        f"{seen['cut']['um_pp']:.2f} um",
        f"{seen['model']['um_pp']:.2f} um",
        f"× {seen['scaled_to']['factor']:.3g}",
        f"{seen['model']['matching_force_n']:.0f} N",
        words,
    ):
        assert number in said.out
    assert "{" not in said.out


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"material": '"cheese"'}, "cheese"),
        ({"chucking_force_n": "344.0"}, "grip margin"),
    ],
)
def test_the_unpredictable_refused(
    console: Console, job_file: JobFile, changes: dict[str, str], said: str
) -> None:
    answer = console("predict", str(job_file(**changes)))
    assert (answer.code, answer.out) == (1, "")
    assert said in answer.err


def test_a_job_that_clamps_too_hard_is_told_what_passes(console: Console, job_file: JobFile) -> None:
    """49.12 MPa of bending and 1.26 of hoop force at 1314 N: 120 MPa, where plain aluminium yields, at 3129 N."""
    for force_n, code, mark in ((3130, 1, "✗"), (3129, 0, "✓")):
        forces = {"chucking_force_n": f"{force_n}.0", "lobe_force_n": f"{force_n}.0"}
        answer = console("predict", str(job_file(**forces)))
        assert answer.code == code
        (line,) = [line for line in answer.out.splitlines() if "stress under the jaws" in line]
        assert line.startswith(mark) and line.endswith("<= 120 MPa (3129 N)")


def test_limits_beyond_what_the_machine_has_limit_nothing(console: Console) -> None:
    """A bar has hardly any lobe: 6e8 N would change it by the tolerance, and 3e7 rpm would be too fast for it."""
    seen = console("predict", "steel-bar-65", "--json").json
    assert seen["clamping"]["beyond"] == ["scatter", "uncompensated"]
    assert seen["clamping"]["limits_n"]["scatter"] > 6593.0 == seen["clamping"]["limits_n"]["chuck"]
    assert set(seen["envelope"]["beyond"]) == set(seen["envelope"]["at_job"]["rpm"])
    assert (seen["cut"]["crest_deg"], seen["cut"]["high_at_jaws"]) == (None, None)
    said = console("predict", "steel-bar-65").out
    numbers = [float(word) for line in said.splitlines() for word in line.split() if word.isdigit()]
    assert max(numbers) == 6593
    assert "no lobe at the jaws" in said and "high at the jaws" not in said
    assert re.search(r"spindle +3000 +33\.3", said)


def test_strategies_are_marked_like_the_rules(console: Console) -> None:
    lines = console("preview", "lee-2001-experiment-1").out.splitlines()
    assert [line[:9] for line in lines if "paper: " in line] == ["!  paper:"] * 3
    assert [line[:7] for line in lines if "pvt: " in line] == ["✓  pvt:"]


def test_a_job_that_the_default_strategy_cannot_cut_is_refused(console: Console, job_file: JobFile) -> None:
    """A lobe of 350 um p-p at 50 Hz lags by more than the 150 um at which I111 trips; no rule refuses it."""
    path = str(job_file(lobe_error_um_pp="350.0", depth_of_cut_mm="0.5", cut_length_mm="1.0"))
    said = console("preview", path)
    assert said.code == 1
    assert "✗  pvt: the command would run" in said.out
    seen = console("preview", path, "--json")
    assert seen.code == 1
    assert "refusal" not in {finding["severity"] for finding in seen.json["findings"]}
    assert [finding["severity"] for finding in seen.json["strategies"]["pvt"]["findings"]] == ["refusal"]


def test_a_lobe_measured_in_aluminium_is_not_one_of_steel(console: Console, job_file: JobFile) -> None:
    words = "measured, but on another cut"
    assert words not in console("preview", str(job_file())).out
    path = str(job_file(material='"steel"'))
    said = console("preview", path)
    assert words in said.out
    (line,) = [line for line in said.out.splitlines() if "cutting conditions as calibrated" in line]
    assert line.startswith("!") and line.split()[-2:] == ["steel", "Al"]
    assert console("preview", path, "--json").json["lobe_error_source"] == "other_cut"
    refused = console("run", path, "--sim")
    assert refused.code == 1 and "material = steel" in refused.err and "with Al" in refused.err


def test_findings_are_told_in_words_and_not_in_rounded_numbers(console: Console) -> None:
    seen = console("preview", "lee-2001-experiment-1", "--json").json
    for finding in [*seen["findings"], *seen["strategies"]["paper"]["findings"]]:
        assert set(finding) == {"severity", "code", "text"}
        assert finding["text"]
    grip = next(finding for finding in seen["findings"] if finding["code"] == "rule.grip_margin")
    assert grip["text"] == "grip margin: 645.709 N (>= 0 N)"


def test_the_drive_is_compared_like_with_like(console: Console) -> None:
    """I116 is 500 counts/ms at 5000 counts/mm, 100 mm/s; 2000 N are peak and 400 N continuous (Table 2)."""
    drive = console("preview", "lee-2001-experiment-1", "--json").json["drive"]
    assert drive["velocity_mm_per_s_limit"] == pytest.approx(100)
    assert drive["velocity_mm_per_s_percent"] == pytest.approx(drive["velocity_mm_per_s"])
    assert drive["force_n_percent"] == pytest.approx(drive["force_n"] / 20)
    assert drive["force_rms_n"] == pytest.approx(drive["force_n"] / math.sqrt(2))
    assert drive["force_rms_n_percent"] == pytest.approx(drive["force_rms_n"] / 4)
    shown = console("preview", "lee-2001-experiment-1").out
    for row in ("peak velocity", "peak thrust", "rms thrust", "peak current"):
        assert row in shown


MACHINE: MachineProfile = load_machine("lee-2001-lathe").machine


def short(name: str) -> Job:
    return replace(load_job(name).job, cut_length_mm=1.0)


def band_of(job: Job, strategy: Strategy = Strategy.CAM) -> Band:
    asked = ProgramInput(job=job, machine=MACHINE, strategy=strategy)
    band = predicted_band(underway(outlook(job, MACHINE, strategy), {strategy: program_of(asked)}), strategy)
    assert band is not None
    return band


@pytest.mark.long
def test_the_first_part_of_a_lathe_with_dry_guides_is_within_the_band_of_the_model() -> None:
    """3 N of the plant `realistic` hold a thin ring's tool so that 23 of 28 um are left."""
    job = short("thin-ring-3-jaws")
    bench = connected(MACHINE, true=plant_named("steady", MACHINE, 3))
    bench.homed(job)
    asked = program_of(ProgramInput(job=job, machine=MACHINE, strategy=Strategy.CAM)).plan
    bench.cut(asked)  # type: ignore[arg-type]
    trace = bench.sim.measure()
    left_um = evaluate(trace.angle_deg, trace.deviation_um, 50.0, state="free").ront_um
    band = band_of(job)
    assert left_um > 20.0
    assert band.low_um <= left_um <= band.high_um < 1.2 * job.lobe_error_um_pp


def test_a_round_part_keeps_what_the_spindle_wanders() -> None:
    """A perfect tool on an axis that wanders by 1.2 um leaves 1.1 to 1.5 um."""
    band = band_of(short("steel-bar-65"))
    assert band.low_um < 1.1
    assert 1.5 < band.high_um < 2.5


def test_friction_is_that_of_the_describing_function_with_its_overtones() -> None:
    """8 x 5 N / pi on 1.755 um/N at 50 Hz, and a third and a fifth of it on 0.307 and 0.107 um/N."""
    job = short("lee-2001-experiment-1")
    band = band_of(job)
    assert band.friction_um == pytest.approx(8 * 5.0 / 3.14159 * (1.755 + 0.3071 / 3 + 0.1069 / 5), rel=1e-3)
    assert band.assumed_friction_n == 5.0
    assert band_of(job, Strategy.NONE).friction_um == pytest.approx(0.0, abs=1e-6)


def test_what_is_assumed_is_said_to_people_and_programs(console: Console, job_file: JobFile) -> None:
    words = ("preview", str(job_file(cut_length_mm="1.0")), "--strategy", "cam")
    band = console(*words, "--json").json["predicted"]["band"]
    said = {reason["code"]: reason for reason in band["because"]}
    shown = console(*words, "--lang", "ko").out
    assert f"{band['high_um']:.1f} um)" in shown
    for code, amount in (("band.friction.assumed", "5 N"), ("band.spindle", "2 um")):
        assert said[code]["text"].startswith("assumed: ")
        assert amount in said[code]["text"]
        (line,) = (line for line in shown.splitlines() if line.startswith("가정: ") and amount in line)
        assert line.endswith(f"{said[code]['um']:.2f}")


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
def test_a_bad_trace_names_its_line(console: Console, tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    path = tmp_path / "trace.csv"
    path.write_text(text)
    said = console("roundness", str(path))
    assert said.code == 1
    assert said.out == ""
    assert "trace.csv" in said.err
    for word in words:
        assert word in said.err


def test_jobs_lists_what_is_bundled_with_its_conditions_and_why_one_is_broken(
    console: Console, data_folder: Path
) -> None:
    folder = data_folder / "trilobe" / "jobs"
    folder.mkdir(parents=True)
    (folder / "broken.toml").write_text("name = 3")
    jobs = {job["name"]: job for job in console("jobs", "--json").json["jobs"]}
    one = jobs["lee-2001-experiment-1"]
    assert (one["diameter_mm"], one["wall_thickness_mm"], one["lobe_error_um_pp"]) == (52, 2.5, 55)
    assert {"chucking_force_n", "feed_mm_per_rev", "cut_length_mm"} <= set(one["assumed"])
    assert jobs["broken"]["problems"]
    said = console("jobs")
    assert said.code == 0 and "lee-2001-experiment-2" in said.out and "broken" in said.out
    assert console("--json", "jobs").json == console("jobs", "--json").json, "it may stand before the command"


def test_the_version_is_stated(console: Console) -> None:
    said = console("--version")
    assert said.code == 0 and said.out.startswith("trilobe 0.")
    stated = console("--version", "--json").json
    assert stated == {"schema": 1, "name": "trilobe", "version": said.out.split()[1]}
