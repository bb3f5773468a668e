"""Kept calibrations of a chuck: they fill what a profile leaves open, and never overrule what it says."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.calibrated_chuck import calibrated
from profiles.calibration.contact import bending_um, contact_um
from profiles.chucking.advice import clamping_advice
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.rules import Severity, lobe_as_found
from profiles.store import BUNDLED_MACHINES, load_job, load_machine

Console = Callable[..., Any]

JOB = load_job("lee-2001-experiment-1").job
LATHE = load_machine("lee-2001-lathe").machine
OPEN = replace(
    LATHE,
    chuck=replace(
        LATHE.chuck,
        force_per_torque_n_per_n_m=None,
        force_sd_percent=None,
        jaw_stiffness_n_per_um=None,
        jaw_contact_exponent=None,
    ),
)
TORQUE = np.repeat([10.0, 20.0, 30.0, 40.0], 3)


@pytest.fixture
def data(data_folder: Path) -> Path:
    return data_folder / "trilobe"


def wrench(folder: Path, slope: float, offset_n: float, sd_n: float) -> str:
    force = offset_n + slope * TORQUE + np.random.default_rng(4).normal(0.0, sd_n, TORQUE.size)
    rows = [f"{t:g},{f:.3f}" for t, f in zip(TORQUE, force, strict=True)]
    path = folder / "wrench.csv"
    path.write_text("\n".join(["torque_n_m,force_n", *rows]))
    return str(path)


def jaws(folder: Path) -> str:
    """Three jaws of 60 N/um at 1000 N, alpha 0.4, length 30 mm, on a steel bar, with noise of 0.01 um."""
    rows, rng = (
        ["# youngs_modulus_gpa: 206", "chucking_force_n,load_n,angle_deg,diameter_mm,overhang_mm,deflection_um"],
        (np.random.default_rng(5)),
    )
    for total in (1500.0, 3000.0, 6000.0):
        for load in (150.0, 400.0):
            for angle in (0.0, 30.0, 60.0):
                for overhang in (40.0, 125.0):
                    k = 60.0 * (total / 3 / 1000.0) ** 0.4
                    um = contact_um(
                        k,
                        0.4,
                        30.0,
                        jaws=3,
                        force_per_jaw_n=total / 3,
                        load_n=load,
                        past_jaw_deg=angle,
                        overhang_mm=overhang,
                    ) + bending_um(load, overhang, 65.0, 206.0)
                    rows.append(f"{total},{load},{angle},65,{overhang},{float(um) + rng.normal(0.0, 0.01):.5f}")
    path = folder / "jaws.csv"
    path.write_text("\n".join(rows))
    return str(path)


def warned(job: Job, machine: MachineProfile) -> set[str]:
    return {f.problem.key for f in lobe_as_found(job, machine) if f.severity is Severity.WARNING}


def test_what_a_profile_leaves_open_comes_from_the_newest_calibrations(
    console: Console, tmp_path: Path, data: Path
) -> None:
    assert calibrated(OPEN, data).machine == OPEN
    for words in ((wrench(tmp_path, 200.0, 0.0, 50.0),), (wrench(tmp_path, 300.0, 400.0, 60.0), "--affine")):
        said = console("calibrate", "chuck", *words, "--keep", "--json")
        assert said.code == 0
    assert set(said.json["found"]["profile"]) == {
        "force_per_torque_n_per_n_m",
        "force_offset_n",
        "force_sd_percent",
    }
    assert console("calibrate", "chuck", jaws(tmp_path), "--keep").code == 0
    found = calibrated(OPEN, data)
    chuck = found.machine.chuck
    assert chuck.force_per_torque_n_per_n_m == pytest.approx(300.0, rel=0.02)
    assert chuck.force_offset_n == pytest.approx(400.0, abs=120.0)
    # 60 N of 400 + 300 x 25 N.
    assert chuck.force_sd_percent == pytest.approx(100 * 60 / 7900, rel=0.5)
    assert chuck.jaw_stiffness_n_per_um == pytest.approx(60.0, rel=0.02)
    assert chuck.jaw_contact_exponent == pytest.approx(0.4, abs=0.02)
    assert found.sources["force_offset_n"] == found.sources["force_sd_percent"] == said.json["date"]
    assert found.sources["jaw_stiffness_n_per_um"] > said.json["date"]
    assert found.sources["jaw_length_mm"] == "", "that one is the profile's own"
    # The profile says 40 mm of jaws; the deflections say 30.
    assert [(p.code, p.key) for p in found.warnings] == [("calibration.differs", "chuck.jaw_length_mm")]
    torque = clamping_advice(JOB, found.machine).torque_n_m
    assert torque == pytest.approx((1314.0 - 400.0) / 300.0, rel=0.15)
    assert clamping_advice(JOB, OPEN).torque_n_m is None


def test_a_prediction_says_where_what_it_knows_of_the_chuck_is_from(console: Console, tmp_path: Path) -> None:
    text = (BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if "force_per_torque" not in line]
    machine = tmp_path / "open.toml"
    machine.write_text("\n".join(kept), encoding="utf-8")
    words = ("predict", JOB.name, "--machine", str(machine), "--json")
    assert console(*words).json["clamping"]["torque_n_m"] is None
    wrench_words = (wrench(tmp_path, 300.0, 0.0, 50.0), "--machine", str(machine), "--keep", "--json")
    date = console("calibrate", "chuck", *wrench_words).json["date"]
    said = console(*words).json
    assert said["clamping"]["torque_n_m"] == pytest.approx(1314 / 300, rel=0.02)
    assert said["sources"]["chuck.force_per_torque_n_per_n_m"] == date
    assert said["sources"]["chuck.jaw_length_mm"] == "profile"
    told = console(*words[:-1])
    assert f"from the calibration of {date}: chuck.force_per_torque_n_per_n_m" in told.out


@pytest.mark.parametrize(("slope", "told"), [(377.0, []), (300.0, ["calibration.differs"])])
def test_what_a_profile_says_it_says_and_a_contradiction_is_told(
    console: Console, tmp_path: Path, data: Path, slope: float, told: list[str]
) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, slope, 0.0, 50.0), "--keep").code == 0
    found = calibrated(LATHE, data)
    assert found.machine == LATHE
    assert set(found.sources.values()) == {""}
    assert [problem.code for problem in found.warnings] == told


def test_half_a_line_of_the_profile_is_not_completed(console: Console, tmp_path: Path, data: Path) -> None:
    """With a slope of its own the profile has no offset: that of another line would be of no line at all."""
    assert console("calibrate", "chuck", wrench(tmp_path, 300.0, 400.0, 60.0), "--affine", "--keep").code == 0
    only_slope: MachineProfile = replace(OPEN, chuck=replace(OPEN.chuck, force_per_torque_n_per_n_m=310.0))
    found = calibrated(only_slope, data)
    assert found.machine.chuck.force_offset_n is None
    assert found.machine.chuck.force_sd_percent is not None


def test_a_record_without_its_numbers_is_refused(console: Console, tmp_path: Path, data: Path) -> None:
    assert console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 50.0), "--keep").code == 0
    (file,) = data.rglob("wrench-*.json")
    record = json.loads(file.read_text())
    del record["found"]["slope_n_per_n_m"]
    file.write_text(json.dumps(record))
    with pytest.raises(ProfileError, match=r"calibration\.record"):
        calibrated(LATHE, data)


def test_a_slope_that_is_hardly_known_is_told(console: Console, tmp_path: Path) -> None:
    sure = console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 300.0))
    unsure = console("calibrate", "chuck", wrench(tmp_path, 377.0, 0.0, 3000.0))
    assert (sure.code, unsure.code) == (0, 0)
    assert "slope" not in sure.err
    assert "slope" in unsure.err and "<= 10 %" in unsure.err
    assert "force_sd_percent = " in sure.out


def test_a_lobe_is_kept_with_the_chuck_and_the_tool_that_it_was_found_with(
    console: Console, tmp_path: Path, data: Path
) -> None:
    angle = np.arange(360.0)
    rng = np.random.default_rng(1)
    deviation = 27.5 * np.cos(3 * np.radians(angle - 92.0)) + rng.normal(0.0, 0.3, 360)
    rows = [f"{a:g},{d:.4f}" for a, d in zip(angle, deviation, strict=True)]
    head = ("# state: free", "# direction: spindle", "# start_mark: spindle index", "angle_deg,deviation_um")
    path = tmp_path / "trace.csv"
    path.write_text("\n".join([*head, *rows]))
    assert console("calibrate", "lobe", str(path), "--job", JOB.name, "--keep").code == 0
    kept = load_job(f"{JOB.name}-2", data / "jobs").job
    assert (kept.lobe_chuck, kept.lobe_tool) == (LATHE.chuck.name, LATHE.tool.name)
    other = load_machine("turbo-ethernet-lathe").machine
    judged = {name: warned(kept, machine) for name, machine in (("own", LATHE), ("other", other))}
    assert judged == {"own": set(), "other": {"chuck.name", "tool.name"}}
